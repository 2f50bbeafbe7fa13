"""Proof of the first motion: at a crawl, the error must fall as the vehicle moves.

A camera mounted the wrong way round, a flipped axis or a wrong goal make the law push away from
the goal. So the vehicle first moves at a crawl, and flies on only if the error fell while it
did. What counts as motion is what the vehicle's own estimate shows in the direction that it was
asked for: a vehicle answers late, and an error that stays while nothing has moved yet proves
nothing. From the moment it moves it has less than a second; it has three to begin. The beginning
may be jitter of the estimate (0.02 m/s at rest): nothing is judged before a few centimetres were
flown. Errors are compared as medians of a few reports, since a single one is noisy; and where they
have not fallen they are looked at once more, a fifth of that time later: of a goal that is metres
away a few centimetres are a percent.

Two errors are looked at, and either may give the proof. The pose error depends on depth, which is
learnt during the very same motion and may make it leap; the feature error does not, but stays much
the same where way and turn cancel in the picture and the vehicle turns before it flies. Whoever
flies away sees both grow.

A camera that is mounted another way round levels its pictures the wrong way as well, and that may
make the feature error fall for a moment. So perception also tells whether the camera's course is
the vehicle's own; where it is not there is no need to wait for errors.
"""

from __future__ import annotations

import enum
import math
import statistics
from dataclasses import dataclass, field

from dfvs_core.gate.config import GateTiming, S
from dfvs_core.gate.limits import BodyVelocity
from dfvs_core.gate.states import Cause
from dfvs_core.wire.link import PerceptionReport

BEGUN_M = 0.005
BEGUN_RAD = 0.01
"""Motion in the wanted direction that counts as its beginning."""

MIN_PATH_M = 0.03
MIN_TURN_RAD = 0.05
"""Motion below which the error need not show a change."""

ASKED_M = 0.1
ASKED_RAD = 0.15
"""Motion that was asked for and that a vehicle which follows would have begun."""

MIN_COURSE_AGREEMENT = 0.3
"""Cosine of the angle between the camera's course and the vehicle's own that must be exceeded."""

_LONGEST_STEP_S = 0.1
_MEDIAN_OF = 5
_MIN_REPORTS = 4


class Proof(enum.Enum):
    """What the first motion has shown so far."""

    OPEN = "open"
    GIVEN = "given"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class OwnMotion:
    """How the vehicle moves by its own estimate: velocity NED in m/s and heading in rad."""

    velocity_m_s: tuple[float, float, float]
    yaw_rad: float


@dataclass(slots=True)
class MotionProof:
    """Errors seen, motion asked for and motion made since the vehicle was let go.

    Vectors are (forward, right, down) in m, angles in rad.
    """

    start_ns: int
    errors: list[tuple[float, float, float | None]] = field(default_factory=list)
    courses: list[float] = field(default_factory=list)
    asked_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    asked_rad: float = 0.0
    moved_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turned_rad: float = 0.0
    begun_ns: int | None = None
    """When the vehicle was first seen to move as asked."""
    cause: Cause = Cause.ERROR_NOT_FALLING
    objection: str = ""
    """Why the proof failed."""
    _is_doubted: bool = False
    """Whether the errors had not fallen when they were first looked at."""
    _last_ns: int | None = None
    _last_yaw_rad: float = 0.0

    def see(self, report: PerceptionReport) -> None:
        """Take the errors of a good report, and the course where it tells one."""
        self.errors.append((report.error_m, report.error_rad, report.feature_error))
        if report.course_agreement is not None:
            self.courses.append(report.course_agreement)

    def follow(self, setpoint: BodyVelocity, own: OwnMotion, now_ns: int) -> None:
        """Count what was asked for and what was done since the last call."""
        if self._last_ns is not None:
            dt_s = min((now_ns - self._last_ns) / S, _LONGEST_STEP_S)
            asked = (setpoint.forward_m_s, setpoint.right_m_s, setpoint.down_m_s)
            self.asked_m = _advance(self.asked_m, asked, dt_s)
            self.asked_rad += setpoint.yaw_rad_s * dt_s
            self.moved_m = _advance(self.moved_m, _in_body(own), dt_s)
            self.turned_rad += math.remainder(own.yaw_rad - self._last_yaw_rad, math.tau)
        self._last_ns, self._last_yaw_rad = now_ns, own.yaw_rad
        has_begun = self.followed_m >= BEGUN_M or self.followed_rad >= BEGUN_RAD
        if self.begun_ns is None and has_begun:
            self.begun_ns = now_ns

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

    def judge(self, now_ns: int, timing: GateTiming) -> Proof:
        """Tell what is proven; ``cause`` and ``objection`` say why where the proof failed."""
        if self.begun_ns is None:
            was_asked = math.hypot(*self.asked_m) >= ASKED_M or abs(self.asked_rad) >= ASKED_RAD
            if not was_asked or now_ns - self.start_ns < timing.proof_limit_ns:
                return Proof.OPEN
            return self._fail(
                Cause.ERROR_NOT_FALLING,
                f"the vehicle moved {self.followed_m:.2f} m and {self.followed_rad:.2f} rad "
                f"of {math.hypot(*self.asked_m):.2f} m and {abs(self.asked_rad):.2f} rad",
            )
        if len(self.courses) >= _MIN_REPORTS and (text := self._other_course()):
            return self._fail(Cause.OTHER_COURSE, text)
        has_shown = self.followed_m >= MIN_PATH_M or self.followed_rad >= MIN_TURN_RAD
        since_ns = now_ns - self.begun_ns
        look_ns = timing.last_proof_ns if self._is_doubted else timing.proof_ns
        if not has_shown or since_ns < look_ns:
            return Proof.OPEN
        other, unchanged = self._other_course(), self._not_fallen()
        if not other and not unchanged:
            return Proof.GIVEN
        if since_ns < timing.last_proof_ns:
            self._is_doubted = True
            return Proof.OPEN
        cause = Cause.OTHER_COURSE if other else Cause.ERROR_NOT_FALLING
        return self._fail(cause, other or unchanged)

    def _fail(self, cause: Cause, objection: str) -> Proof:
        self.cause, self.objection = cause, objection
        return Proof.FAILED

    def _other_course(self) -> str:
        """Say by how much the camera's course is another one than the vehicle's own."""
        if not self.courses:
            return ""
        cosine = statistics.median(self.courses[-_MEDIAN_OF:])
        if cosine > MIN_COURSE_AGREEMENT:
            return ""
        angle = math.degrees(math.acos(cosine))
        return (
            f"{angle:.0f}° from where the vehicle says it goes; is it mounted as camera.mount says?"
        )

    def _not_fallen(self) -> str:
        """Name the error that did not fall although the vehicle moved."""
        if len(self.errors) < _MIN_REPORTS:
            return f"only {len(self.errors)} reports to judge by"
        features = [e[2] for e in self.errors if e[2] is not None]
        if len(features) < len(self.errors):
            return self._pose_not_fallen()
        objection = _not_falling("feature error", features)
        return objection if objection and self._pose_not_fallen() else ""

    def _pose_not_fallen(self) -> str:
        """Name the part of the pose error that did not fall although the vehicle moved."""
        moved, turned = self.followed_m >= MIN_PATH_M, self.followed_rad >= MIN_TURN_RAD
        if moved and (text := _not_falling("distance", [e[0] for e in self.errors])):
            return text
        return _not_falling("angle", [e[1] for e in self.errors]) if turned else ""


def _advance(
    vector: tuple[float, float, float], velocity: tuple[float, float, float], dt_s: float
) -> tuple[float, float, float]:
    x, y, z = (a + v * dt_s for a, v in zip(vector, velocity, strict=True))
    return x, y, z


def _in_body(own: OwnMotion) -> tuple[float, float, float]:
    """Velocity forward, right and down in the level body frame."""
    north, east, down = own.velocity_m_s
    c, s = math.cos(own.yaw_rad), math.sin(own.yaw_rad)
    return c * north + s * east, c * east - s * north, down


def _not_falling(name: str, errors: list[float]) -> str:
    count = min(_MEDIAN_OF, len(errors) // 2)
    first, last = statistics.median(errors[:count]), statistics.median(errors[-count:])
    return "" if last < first else f"{name} went from {first:.4f} to {last:.4f}"
