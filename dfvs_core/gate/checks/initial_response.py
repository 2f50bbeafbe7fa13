"""Initial-response check of the servo law, in a reduced-speed phase.

A camera that is mounted another way round than the settings say, or a flipped axis, makes the law
push away from the goal. So the vehicle first moves at reduced speed. It flies on once either of two
tests has passed:

- **Mounting.** Perception compares the tilt that the images show with that of the gyroscopes and
  reports a test statistic, in standard deviations. Clearly positive, the mounting is right: the law
  then pushes towards the goal. Clearly negative it ends the flight, now as later. It needs no
  position or velocity estimate.
- **Error.** The feature error or the pose error has fallen clearly, against the noise of the
  reports, while the vehicle moved as it was asked to. Where the mounting can be told, this counts
  only at the time limit: a turn about the vertical comes right however the camera is mounted.

What cannot be told apart yet goes on at reduced speed, up to a time limit. Errors are compared as
medians of a few reports. The feature error does not depend on what is known of depth; the pose
error does, but it falls where the feature error stays since way and turn cancel in the image.

A HOLD interrupts the check: neither its time nor its motion counts, nor what an error changes by in
it. Errors are compared within each period in SERVO, and their falls are added up. A change of a
route's goal interrupts it likewise, and motion counts anew, towards the next goal.
"""

import enum
import itertools
import math
import statistics
from dataclasses import dataclass, field
from typing import NamedTuple

from dfvs_core.gate.config import GateTiming, S
from dfvs_core.gate.limits import BodyVelocity
from dfvs_core.messages.link import MOUNTING_SCORE, PerceptionReport

MIN_PATH_M = 0.03
MIN_TURN_RAD = 0.05
"""Motion in the direction that was asked for below which the error need not show a change."""

ASKED_M = 0.1
ASKED_RAD = 0.15
"""Motion that must have been asked for before a missing response ends the flight."""

CLEAR_FALL = 4.0
"""Fall of an error, in standard deviations of the difference of two medians, that is no chance."""

DOUBTFUL_MOUNTING = -2.0
"""Mounting score below which a falling error confirms nothing."""

_LONGEST_STEP_S = 0.1
_MEDIAN_OF = 5
_MIN_REPORTS = 4
_MOST_REPORTS = 300
"""Errors that are kept: the first ones, and the last."""


Vector = tuple[float, float, float]


class Response(enum.Enum):
    """What the initial motion has shown so far."""

    OPEN = "open"
    CONFIRMED = "confirmed"
    FAILED = "failed"


class Fall(NamedTuple):
    """Fall of an error over one or more periods in SERVO, and its standard deviation."""

    amount: float
    deviation: float

    @property
    def is_clear(self) -> bool:
        """Whether the fall is more than noise explains."""
        return self.amount > CLEAR_FALL * self.deviation

    def plus(self, other: "Fall") -> "Fall":
        """Sum of the falls of two periods."""
        return Fall(self.amount + other.amount, math.hypot(self.deviation, other.deviation))


_NONE = Fall(0.0, 0.0)
_UNKNOWN = Fall(math.nan, math.nan)
"""Of an error that some report lacks; with any other fall it stays unknown."""


@dataclass(slots=True)
class InitialResponse:
    """Errors reported, motion asked for and motion made since the vehicle was released to servo.

    Vectors are (forward, right, down) in m, angles in rad. ``start_ns`` and ``errors`` are of the
    present period in SERVO; ``earlier_ns`` and ``earlier`` are the time in SERVO, and the falls of
    distance, angle and feature error, in the periods before it.
    """

    start_ns: int
    errors: list[tuple[float, float, float | None]] = field(default_factory=list)
    earlier_ns: int = 0
    earlier: tuple[Fall, Fall, Fall] = (_NONE, _NONE, _NONE)
    mounting_score: float | None = None
    """The last one that was reported."""
    is_mounted_right: bool = False
    """Whether one was high enough; perception asks for no more tilt then, and forgets."""
    goals_left: int = 0
    """Goals of the route that follow the present one."""
    asked_m: Vector = (0.0, 0.0, 0.0)
    asked_rad: float = 0.0
    moved_m: Vector = (0.0, 0.0, 0.0)
    turned_rad: float = 0.0
    _last_ns: int | None = None
    _last_yaw_rad: float = 0.0

    def resume(self, now_ns: int) -> None:
        """Begin another period in SERVO, after a HOLD or a change of a route's goal."""
        self.earlier = self._falls()
        if self._last_ns is not None:
            self.earlier_ns += self._last_ns - self.start_ns
        self.start_ns, self._last_ns = now_ns, None
        self.errors = []

    def change_goal(self, goals_left: int, now_ns: int) -> None:
        """Go on with the route's next goal, which lies in another direction."""
        self.resume(now_ns)
        self.goals_left = goals_left
        self.asked_m = self.moved_m = (0.0, 0.0, 0.0)
        self.asked_rad = self.turned_rad = 0.0

    def update(self, report: PerceptionReport) -> None:
        """Take the errors of a good report, and the mounting's statistic where it has one."""
        self.errors.append((report.error_m, report.error_rad, report.feature_error))
        if len(self.errors) > _MOST_REPORTS:
            del self.errors[_MEDIAN_OF]
        if report.mounting_score is not None:
            self.mounting_score = report.mounting_score
            self.is_mounted_right |= report.mounting_score >= MOUNTING_SCORE

    def integrate(
        self, setpoint: BodyVelocity, velocity_m_s: Vector, yaw_rad: float, now_ns: int
    ) -> None:
        """Count what was asked for and what was done since the last call.

        ``velocity_m_s`` (NED) and ``yaw_rad`` are the vehicle's by its own estimate.
        """
        if self._last_ns is not None:
            dt_s = min((now_ns - self._last_ns) / S, _LONGEST_STEP_S)
            asked = (setpoint.forward_m_s, setpoint.right_m_s, setpoint.down_m_s)
            self.asked_m = _advance(self.asked_m, asked, dt_s)
            self.asked_rad += setpoint.yaw_rad_s * dt_s
            self.moved_m = _advance(self.moved_m, _in_body(velocity_m_s, yaw_rad), dt_s)
            self.turned_rad += math.remainder(yaw_rad - self._last_yaw_rad, math.tau)
        self._last_ns, self._last_yaw_rad = now_ns, yaw_rad

    @property
    def followed_m(self) -> float:
        """How far the vehicle went in the direction that it was asked for, m."""
        length = math.hypot(*self.asked_m)
        dot = sum(a * m for a, m in zip(self.asked_m, self.moved_m, strict=True))
        return dot / length if length > 0.0 else 0.0

    @property
    def followed_rad(self) -> float:
        """How far the vehicle turned to the side that it was asked to, rad."""
        return math.copysign(1.0, self.asked_rad) * self.turned_rad if self.asked_rad else 0.0

    def evaluate(self, now_ns: int, timing: GateTiming) -> Response:
        """Result so far; confirmed only after the least time without a HOLD."""
        period_ns, score = now_ns - self.start_ns, self.mounting_score
        since_ns = self.earlier_ns + period_ns
        if since_ns < timing.response_ns:
            return Response.OPEN
        is_over = since_ns >= timing.response_limit_ns
        may_confirm = score is None or (is_over and score >= DOUBTFUL_MOUNTING)
        if self.is_mounted_right or (may_confirm and self._has_fallen()):
            return Response.CONFIRMED if period_ns >= timing.response_ns else Response.OPEN
        was_asked = math.hypot(*self.asked_m) >= ASKED_M or abs(self.asked_rad) >= ASKED_RAD
        return Response.FAILED if was_asked and is_over else Response.OPEN

    @property
    def objection(self) -> str:
        """Why the check failed."""
        return (
            f"the vehicle moved {self.followed_m:.2f} m and {self.followed_rad:.2f} rad "
            f"of {math.hypot(*self.asked_m):.2f} m and {abs(self.asked_rad):.2f} rad"
        )

    def _has_fallen(self) -> bool:
        """Whether an error has clearly fallen while the vehicle moved as asked."""
        moved, turned = self.followed_m >= MIN_PATH_M, self.followed_rad >= MIN_TURN_RAD
        if not (moved or turned):
            return False
        distance, angle, feature = self._falls()
        return feature.is_clear or (moved and distance.is_clear) or (turned and angle.is_clear)

    def _falls(self) -> tuple[Fall, Fall, Fall]:
        """Falls of distance, angle and feature error over all periods in SERVO."""
        features = [e[2] for e in self.errors if e[2] is not None]
        is_complete = len(features) == len(self.errors)
        distance, angle, feature = self.earlier
        return (
            distance.plus(_fall([e[0] for e in self.errors])),
            angle.plus(_fall([e[1] for e in self.errors])),
            feature.plus(_fall(features) if is_complete else _UNKNOWN),
        )


def _advance(vector: Vector, velocity: Vector, dt_s: float) -> Vector:
    x, y, z = (a + v * dt_s for a, v in zip(vector, velocity, strict=True))
    return x, y, z


def _in_body(velocity_m_s: Vector, yaw_rad: float) -> Vector:
    """Velocity forward, right and down in the level body frame."""
    north, east, down = velocity_m_s
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    return c * north + s * east, c * east - s * north, down


def _fall(errors: list[float]) -> Fall:
    """Fall from the first errors to the last; none where the reports are too few.

    The noise is that of the changes from one report to the next; the median of n values is off by
    1.25 / sqrt(n) of it.
    """
    if len(errors) < _MIN_REPORTS:
        return _NONE
    count = min(_MEDIAN_OF, len(errors) // 2)
    first, last = statistics.median(errors[:count]), statistics.median(errors[-count:])
    changes = [abs(b - a) for a, b in itertools.pairwise(errors)]
    noise = statistics.median(changes) / (0.6745 * math.sqrt(2.0))
    return Fall(first - last, noise * 1.25 * math.sqrt(2.0 / count))
