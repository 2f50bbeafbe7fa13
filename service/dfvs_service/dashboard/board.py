"""What the dashboard knows of one vehicle: its newest words, its history, and the health of links.

Pure: telemetry and the time go in, news for the page comes out as plain mappings.
"""

from __future__ import annotations

import dataclasses
import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

from dfvs_core.errors import WireError
from dfvs_core.schema import dump, parse
from dfvs_core.wire.link import GateStatus
from dfvs_service.dashboard.clock import Moment, SenderClock
from dfvs_service.dashboard.parcel import Picture
from dfvs_service.dashboard.rates import StreamRate

News = dict[str, Any]

_SERVO_NUMBERS = (
    "error_m",
    "error_rad",
    "feature_error_px",
    "residual_px",
    "inlier_share",
    "overlap",
    "condition",
    "depth_m",
    "error_spread_m",
    "scale_spread",
    "odometry_error_m_s",
    "mean_error_m",
    "mean_error_spread_m",
    "mounting_score",
)
_SERVO_VECTORS = ("motion", "velocity_error")
SERVO_COLUMNS = ("t_ms", "delay_ms", *_SERVO_NUMBERS, *_SERVO_VECTORS)
PATH_COLUMNS = ("t_ms", "north_m", "east_m", "down_m", "yaw_rad", "setpoint", "speed_m_s")

_KEPT_ROWS = 3000
_KEPT_TRANSITIONS = 50
_STATUS_FIELDS = frozenset(field.name for field in dataclasses.fields(GateStatus))
_SECRETS = frozenset({"challenge"})
_COUNTERS = ("frames", "refused", "overtaken")
_MOST_STAGES = 32


class VehicleBoard:
    """One vehicle as the dashboard sees it.

    Parameters
    ----------
    name : str
        Of the vehicle.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.status: GateStatus | None = None
        self.seen_ns = 0
        """Monotonic time of the last word of any kind."""
        self.rates = {stream: StreamRate() for stream in ("camera", "servo", "state", "flow")}
        self._clock = SenderClock()
        self._newest: News = {}
        self._servo: deque[list[Any]] = deque(maxlen=_KEPT_ROWS)
        self._path: deque[list[Any]] = deque(maxlen=_KEPT_ROWS)
        self._transitions: deque[News] = deque(maxlen=_KEPT_TRANSITIONS)

    def take(self, stream: str, document: object, now: Moment) -> News:
        """Take a document of a stream; returns what is new to the page.

        Raises
        ------
        DfvsError
            If it does not follow its schema; fields that are not known yet are passed over.
        """
        if not isinstance(document, Mapping):
            raise WireError(f"{stream} telemetry is not a mapping")
        if stream == "state":
            return self._take_state(document, now)
        if stream == "servo":
            return self._take_servo(document, now)
        if stream == "timing":
            return self._take_timing(document)
        return self._take_config(document)

    def _take_state(self, document: Mapping[str, Any], now: Moment) -> News:
        """Take the gate's status."""
        # A newer service may say more than our schema knows.
        known = {key: value for key, value in document.items() if key in _STATUS_FIELDS}
        status = parse(GateStatus, known)
        self._see("state", now)
        t_ms = self._clock.wall_ms(status.t_ns, now)
        shown = {key: value for key, value in dump(status).items() if key not in _SECRETS}
        shown["t_ms"] = t_ms
        shown["since_ms"] = t_ms - max(status.t_ns - status.since_ns, 0) * 1e-6
        shown["takes_orders"] = bool(status.challenge)
        news: News = {"state": shown}
        if self.status is None or status.state != self.status.state:
            transition = {"t_ms": shown["since_ms"], "to": status.state, "cause": status.cause}
            self._transitions.append(transition)
            news["transitions"] = [transition]
        self.status = status
        self._newest["state"] = shown
        if (row := _path_row(status, t_ms)) is not None:
            self._path.append(row)
            news["path"] = [row]
        return news

    def _take_servo(self, document: Mapping[str, Any], now: Moment) -> News:
        """Take one frame's result."""
        t_ns, t_capture_ns = _time(document, "t_ns"), _time(document, "t_capture_ns")
        self._see("servo", now)
        row: list[Any] = [self._clock.wall_ms(t_capture_ns, now), (t_ns - t_capture_ns) * 1e-6]
        row += [_number(document.get(name)) for name in _SERVO_NUMBERS]
        row += [_numbers(document.get(name)) for name in _SERVO_VECTORS]
        self._servo.append(row)
        verdict = {name: str(document.get(name, ""))[:200] for name in ("status", "reason")}
        self._newest["verdict"] = verdict
        return {"servo": [row], "verdict": verdict}

    def _take_timing(self, document: Mapping[str, Any]) -> News:
        """Take the latencies of the stages, and what perception counted."""
        stages = {
            str(name)[:40]: [_number(stage.get(key)) for key in ("p50_ms", "p99_ms")]
            for name, stage in list(_inner(document, "stages").items())[:_MOST_STAGES]
            if isinstance(stage, Mapping)
        }
        counters = {name: _number(document.get(name)) for name in _COUNTERS}
        self._newest["timing"] = {"stages": stages, **counters}
        return {"timing": self._newest["timing"]}

    def _take_config(self, document: Mapping[str, Any]) -> News:
        """Take the resolved settings; the page shows but a few of them."""
        self._newest["settings"] = {
            "model": str(_inner(document, "flow").get("model", ""))[:200],
            "engage": str(_inner(document, "gate").get("engage", ""))[:20],
            "min_confidence": _number(_inner(document, "servo").get("min_confidence")),
            "tolerance_m": _number(_inner(document, "servo").get("tolerance_m")),
            "max_distance_m": _number(_inner(document, "limits").get("max_distance_m")),
        }
        return {"settings": self._newest["settings"]}

    def see_picture(self, stream: str, picture: Picture, now: Moment) -> float:
        """Note a picture of the camera, flow or goal stream; wall-clock time of its stamp, ms."""
        self.seen_ns = now.t_ns
        if stream in self.rates:
            seq = picture.seq if stream == "camera" else None
            self.rates[stream].note(now.t_ns, len(picture.data), seq)
        return self._clock.wall_ms(picture.t_ns, now)

    def link_news(self, now: Moment) -> News:
        """Rates and ages of the streams; whether ages are exact."""
        streams = {name: rate.summary(now.t_ns) for name, rate in self.rates.items()}
        return {"link": {"streams": streams, "is_foreign_clock": self._clock.is_foreign}}

    def history(self) -> News:
        """Everything that a page needs which has just begun to watch."""
        return {
            **self._newest,
            "history": {
                "servo": list(self._servo),
                "path": list(self._path),
                "transitions": list(self._transitions),
            },
        }

    def listing(self, now_ns: int) -> News:
        """One line for the choice of vehicles."""
        state = "" if self.status is None else self.status.state
        return {"name": self.name, "state": state, "age_s": (now_ns - self.seen_ns) * 1e-9}

    def _see(self, stream: str, now: Moment) -> None:
        self.seen_ns = now.t_ns
        self.rates[stream].note(now.t_ns)


def _path_row(status: GateStatus, t_ms: float) -> list[Any] | None:
    vehicle = status.vehicle
    if vehicle is None:
        return None
    speed = math.hypot(*vehicle.velocity_m_s)
    return [t_ms, *vehicle.position_m, vehicle.yaw_rad, list(status.setpoint), speed]


def _time(document: Mapping[str, Any], name: str) -> int:
    value = document.get(name)
    if not isinstance(value, int) or isinstance(value, bool) or abs(value) > 1 << 62:
        raise WireError(f"servo telemetry has {name} = {value!r}"[:200], "ns as an integer")
    return value


def _number(value: object) -> float | None:
    """Finite number, or None: nothing else reaches the page."""
    if not isinstance(value, int | float) or isinstance(value, bool) or abs(value) > 1e300:
        return None
    return float(value) if math.isfinite(value) else None


def _numbers(value: object) -> list[float | None]:
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) > 6:
        return []
    return [_number(item) for item in value]


def _inner(document: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    inner = document.get(name)
    return inner if isinstance(inner, Mapping) else {}
