"""Vehicle model of the dashboard: last telemetry, history, and health of links.

Pure: telemetry and the time go in, news for the page comes out as plain mappings.
"""

import dataclasses
import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

from dfvs_core.errors import WireError
from dfvs_core.messages.frame import NO_CLOCK
from dfvs_core.messages.link import GateStatus, VehicleState
from dfvs_core.messages.schema import dump, parse
from dfvs_service.dashboard.vehicles.clock import Moment, SenderClock
from dfvs_service.dashboard.vehicles.rates import StreamRate
from dfvs_service.dashboard.vehicles.sample import BrowserImage

Update = dict[str, Any]

_SERVO_NUMBERS = (
    "error_m",
    "error_rad",
    "median_error_px",
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
_PATH_NUMBERS = ("north_m", "east_m", "down_m", "roll_rad", "pitch_rad", "yaw_rad")
PATH_COLUMNS = ("t_ms", *_PATH_NUMBERS, "setpoint", "flown")
"""``setpoint`` is the commanded and ``flown`` the estimated velocity in the level body frame:
forward, right, down in m/s, and yaw rate in rad/s (None where it is unknown)."""

_KEPT_ROWS = 3000
_KEPT_PERIOD_MS = 90.0
"""Shortest time between rows of the servo history: five minutes are kept."""
_PAUSE_S = 1.0
_KEPT_TRANSITIONS = 50
_STATUS_FIELDS = frozenset(field.name for field in dataclasses.fields(GateStatus))
_TIMES = frozenset({"t_ms", "since_ms"})
_SECRETS = frozenset({"challenge"})
_COUNTERS = ("frames", "refused", "overtaken")
_MOST_STAGES = 32
_MAX_TIME_NS = 1 << 62


class VehicleModel:
    """One vehicle as the dashboard sees it.

    What is kept is kept by the monotonic clock, so that its times are right after the wall clock
    was set. ``local_clock`` is the identity of this machine's monotonic clock.
    """

    def __init__(self, name: str, local_clock: bytes = NO_CLOCK) -> None:
        self.name = name
        self.status: GateStatus | None = None
        self.rates = {stream: StreamRate() for stream in ("camera", "servo", "state", "flow")}
        self._clock = SenderClock(local_clock)
        self._vehicle: VehicleState | None = None
        self._newest: Update = {}
        self._servo: deque[list[Any]] = deque(maxlen=_KEPT_ROWS)
        self._path: deque[list[Any]] = deque(maxlen=_KEPT_ROWS)
        self._transitions: deque[Update] = deque(maxlen=_KEPT_TRANSITIONS)

    def on_document(self, stream: str, document: object, now: Moment) -> Update:
        """Take a document of a stream; returns what is new to the page.

        Raises
        ------
        DfvsError
            If it does not follow its schema; fields that are not known yet are passed over.
        """
        if not isinstance(document, Mapping):
            raise WireError(f"{stream} telemetry is not a mapping")
        if stream == "state":
            return self._on_state(document, now)
        if stream == "servo":
            return self._on_servo(document, now)
        if stream == "timing":
            return self._on_timing(document, now)
        return self._on_config(document)

    def _on_state(self, document: Mapping[str, Any], now: Moment) -> Update:
        # A newer service may say more than our schema knows.
        known = {key: value for key, value in document.items() if key in _STATUS_FIELDS}
        status = parse(GateStatus, known)
        for t_ns in (status.t_ns, status.since_ns, status.vehicle.t_ns if status.vehicle else 0):
            _check_time(t_ns)
        self.rates["state"].note(now.t_ns)
        self._clock.on_state(status.t_ns, now.t_ns)
        t_ms = self._clock.wall_ms(status.t_ns, now)
        shown = {key: value for key, value in dump(status).items() if key not in _SECRETS}
        shown["t_ms"] = t_ms
        shown["since_ms"] = t_ms - max(status.t_ns - status.since_ns, 0) * 1e-6
        shown["accepts_commands"] = bool(status.challenge)
        update: Update = {"state": shown}
        if self.status is None or status.state != self.status.state:
            transition = {"t_ms": shown["since_ms"], "to": status.state, "cause": status.cause}
            self._transitions.append(_moved(transition, -now.offset_ms))
            update["transitions"] = [transition]
        self.status = status
        self._newest["state"] = _moved(shown, -now.offset_ms)
        vehicle = status.vehicle
        if vehicle is not None and vehicle != self._vehicle:
            vehicle_ms = t_ms - max(status.t_ns - vehicle.t_ns, 0) * 1e-6
            row = [vehicle_ms, *_path_row(vehicle, self._vehicle, status.setpoint)]
            self._vehicle = vehicle
            self._path.append(_moved_row(row, -now.offset_ms))
            update["path"] = [row]
        return update

    def _on_servo(self, document: Mapping[str, Any], now: Moment) -> Update:
        t_ns, t_capture_ns = _time(document, "t_ns"), _time(document, "t_capture_ns")
        self.rates["servo"].note(now.t_ns)
        self._clock.on_message(t_capture_ns, now.t_ns)
        row: list[Any] = [self._clock.wall_ms(t_capture_ns, now), (t_ns - t_capture_ns) * 1e-6]
        row += [_number(document.get(name)) for name in _SERVO_NUMBERS]
        row += [_numbers(document.get(name)) for name in _SERVO_VECTORS]
        kept = _moved_row(row, -now.offset_ms)
        if not self._servo or abs(kept[0] - self._servo[-1][0]) >= _KEPT_PERIOD_MS:
            self._servo.append(kept)
        verdict = {name: str(document.get(name, ""))[:200] for name in ("status", "reason")}
        self._newest["verdict"] = verdict
        return {"servo": [row], "verdict": verdict}

    def _on_timing(self, document: Mapping[str, Any], now: Moment) -> Update:
        """Take the latencies of the stages, and what perception counted."""
        stages = {
            str(name)[:40]: [_number(stage.get(key)) for key in ("p50_ms", "p99_ms")]
            for name, stage in list(_inner(document, "stages").items())[:_MOST_STAGES]
            if isinstance(stage, Mapping)
        }
        counters = {name: _number(document.get(name)) for name in _COUNTERS}
        timing = {"t_ms": now.wall_ms, "stages": stages, **counters}
        self._newest["timing"] = _moved(timing, -now.offset_ms)
        return {"timing": timing}

    def _on_config(self, document: Mapping[str, Any]) -> Update:
        """Take the resolved settings; the page shows but a few of them."""
        self._newest["settings"] = {
            "model": str(_inner(document, "flow").get("model", ""))[:200],
            "engage": str(_inner(document, "gate").get("engage", ""))[:20],
            "min_confidence": _number(_inner(document, "servo").get("min_confidence")),
            "tolerance_m": _number(_inner(document, "servo").get("tolerance_m")),
            "camera_width": _number(_inner(document, "camera").get("width")),
            "max_distance_m": _number(_inner(document, "limits").get("max_distance_m")),
        }
        return {"settings": self._newest["settings"]}

    def on_image(self, stream: str, image: BrowserImage, now: Moment, replaced: int = 0) -> float:
        """Note an image of the camera, flow or goal stream; wall-clock time of its stamp, ms.

        ``replaced`` images directly before it came, but were not read.
        """
        if stream in self.rates:
            seq = image.seq if stream == "camera" else None
            self.rates[stream].note(now.t_ns, len(image.data), seq, replaced)
        # The service refuses frames that its own clock did not stamp: the goal's counts for both.
        if stream == "goal" or not self._clock.is_identified:
            self._clock.identify(image.clock)
        if stream != "goal":  # it was stamped when the service took it up, and is kept since
            self._clock.on_message(image.t_ns, now.t_ns)
        return self._clock.wall_ms(image.t_ns, now)

    def link_update(self, now: Moment) -> Update:
        """Rates and ages of the streams; whether ages are exact."""
        streams = {name: rate.summary(now.t_ns) for name, rate in self.rates.items()}
        link = {"t_ms": now.wall_ms, "streams": streams, "is_foreign_clock": self._clock.is_foreign}
        return {"link": link}

    def history(self, now: Moment) -> Update:
        """Everything that a page needs which has just begun to watch."""
        by_ms = now.offset_ms
        return {
            **{key: _moved(value, by_ms) for key, value in self._newest.items()},
            "history": {
                "servo": [_moved_row(row, by_ms) for row in self._servo],
                "path": [_moved_row(row, by_ms) for row in self._path],
                "transitions": [_moved(transition, by_ms) for transition in self._transitions],
            },
        }

    def listing(self, now: Moment) -> Update:
        """One line for the choice of vehicles: name, newest state, and when it was sent."""
        state = _moved(self._newest.get("state", {}), now.offset_ms)
        return {"name": self.name, "state": state.get("state", ""), "t_ms": state.get("t_ms")}


def _moved(document: Update, by_ms: float) -> Update:
    """Document with its times moved."""
    return {key: value + by_ms if key in _TIMES else value for key, value in document.items()}


def _moved_row(row: list[Any], by_ms: float) -> list[Any]:
    """Row of a table with its time moved."""
    return [row[0] + by_ms, *row[1:]]


def _path_row(
    vehicle: VehicleState, before: VehicleState | None, setpoint: Sequence[float]
) -> list[Any]:
    """``PATH_COLUMNS`` without the time."""
    cos, sin = math.cos(vehicle.yaw_rad), math.sin(vehicle.yaw_rad)
    north, east, down = vehicle.velocity_m_s
    forward, right = cos * north + sin * east, cos * east - sin * north
    flown = _numbers([forward, right, down, _yaw_rate(vehicle, before)])
    angles = vehicle.roll_rad, vehicle.pitch_rad, vehicle.yaw_rad
    return [*vehicle.position_m, *angles, list(setpoint), flown]


def _yaw_rate(vehicle: VehicleState, before: VehicleState | None) -> float | None:
    """Mean yaw rate since the state before, rad/s; None after a pause."""
    dt_s = 0.0 if before is None else (vehicle.t_ns - before.t_ns) * 1e-9
    if before is None or not 0 < dt_s < _PAUSE_S:
        return None
    return math.remainder(vehicle.yaw_rad - before.yaw_rad, 2 * math.pi) / dt_s


def _time(document: Mapping[str, Any], name: str) -> int:
    value = document.get(name)
    if not isinstance(value, int) or isinstance(value, bool):
        raise WireError(f"servo telemetry has {name} = {value!r}"[:200], "ns as an integer")
    _check_time(value)
    return value


def _check_time(t_ns: int) -> None:
    if abs(t_ns) > _MAX_TIME_NS:
        raise WireError(f"a time of {t_ns} ns"[:200], "less than 2**62 ns")


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
