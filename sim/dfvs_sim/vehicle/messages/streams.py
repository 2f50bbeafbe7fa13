"""How often each message is streamed, on which link."""

from collections.abc import Mapping
from dataclasses import dataclass

from dfvs_sim.vehicle.status import NS_PER_S

COMPANION, GROUND = "companion", "ground"

COMPANION_RATES_HZ: Mapping[str, float] = {
    "HEARTBEAT": 1.0,
    "CURRENT_MODE": 0.5,
    "ATTITUDE": 100.0,
    "ATTITUDE_QUATERNION": 50.0,
    "GLOBAL_POSITION_INT": 50.0,
    "LOCAL_POSITION_NED": 30.0,
    "ODOMETRY": 30.0,
    "GPS_RAW_INT": 8.0,
    "SYS_STATUS": 5.0,
    "EXTENDED_SYS_STATE": 5.0,
    "SYSTEM_TIME": 1.0,
    "HOME_POSITION": 0.5,
    "BATTERY_STATUS": 0.5,
}
GROUND_RATES_HZ: Mapping[str, float] = {
    **COMPANION_RATES_HZ,
    "ATTITUDE": 50.0,
    "LOCAL_POSITION_NED": 50.0,
    "ODOMETRY": 0.0,
    "SYS_STATUS": 1.0,
    "EXTENDED_SYS_STATE": 1.0,
    "GPS_RAW_INT": 1.0,
}
RATES_HZ: Mapping[str, Mapping[str, float]] = {
    COMPANION: COMPANION_RATES_HZ,
    GROUND: GROUND_RATES_HZ,
}

_FASTEST_US = 4000
"""Shortest interval that SET_MESSAGE_INTERVAL is granted: one step of the simulation."""

_ON_NEWS = "CURRENT_MODE"
"""Message that PX4 sends only where the status was published since the last one."""


class Schedule:
    """Which messages are due on one link."""

    def __init__(self, rates_hz: Mapping[str, float], now_ns: int) -> None:
        self._defaults = dict(rates_hz)
        self._next: dict[str, int] = {}
        self._interval: dict[str, int] = {}
        for name, rate in rates_hz.items():
            self._set(name, rate, now_ns)
        self._soonest = now_ns

    def set_interval(self, name: str, interval_us: float, now_ns: int) -> None:
        """SET_MESSAGE_INTERVAL: -1 stops the stream, 0 restores its default."""
        if interval_us > 0:
            self._set(name, 1e6 / max(_FASTEST_US, interval_us), now_ns)
        else:
            self._set(name, 0.0 if interval_us < 0 else self._defaults.get(name, 0.0), now_ns)

    def interval_us(self, name: str) -> int:
        """Interval of the stream, -1 where it is off (MESSAGE_INTERVAL)."""
        return self._interval[name] // 1000 if name in self._interval else -1

    def due(self, now_ns: int) -> list[str]:
        """Names of the messages to send now; a late stream skips what it missed, in step."""
        if now_ns < self._soonest:
            return []
        names = [name for name, when in self._next.items() if when <= now_ns]
        for name in names:
            interval = self._interval[name]
            missed = (now_ns - self._next[name]) // interval
            self._next[name] += (missed + 1) * interval
        self._soonest = min(self._next.values(), default=now_ns + NS_PER_S)
        return names

    def _set(self, name: str, rate_hz: float, now_ns: int) -> None:
        self._next.pop(name, None)
        self._interval.pop(name, None)
        if rate_hz > 0.0:
            self._interval[name] = round(NS_PER_S / rate_hz)
            self._next[name] = now_ns
        self._soonest = now_ns


@dataclass(slots=True)
class LinkState:
    """One MAVLink connection: its streams, and when a ground station last sent on it."""

    schedule: Schedule
    gcs_ns: int | None = None
    dropped: bool = False
    _news_sent_ns: int = -1

    def due(self, now_ns: int, news_ns: int) -> list[str]:
        """Names of the messages to send now; ``news_ns``: when the status was published last."""
        names = self.schedule.due(now_ns)
        if _ON_NEWS in names:
            if self._news_sent_ns < news_ns:
                self._news_sent_ns = now_ns
            else:
                names.remove(_ON_NEWS)
        return names
