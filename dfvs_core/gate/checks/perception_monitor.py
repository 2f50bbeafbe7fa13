"""Monitor of perception's reports: validity, age, rate, reached goal."""

import itertools
import math
import statistics
from collections import deque
from dataclasses import dataclass, field

from dfvs_core.gate.config import MS, GateTiming, S
from dfvs_core.gate.limits import ZERO, BodyVelocity
from dfvs_core.gate.states import Cause
from dfvs_core.gate.vehicle import Fault
from dfvs_core.messages.link import MOUNTING_SCORE, PerceptionReport

PACE_NS = 1 * S
"""Time over which the rate of frames is counted."""

MAX_PLAUSIBLE_SPEED_M_S = 10.0
MAX_PLAUSIBLE_YAW_RAD_S = 10.0
"""A servo law that asks for more is broken; what is merely too fast gets scaled down."""

_OTHER_GOAL: Fault = (Cause.REPORT_REJECTED, "it is about another goal")


def report_fault(report: PerceptionReport, t_ns: int, timing: GateTiming) -> Fault | None:
    """Name the first thing that forbids to fly by a report that arrived at ``t_ns``."""
    if implausibility := _implausibility(report):
        return Cause.REPORT_REJECTED, implausibility
    if not report.healthy:
        return Cause.REPORT_UNHEALTHY, report.reason
    age = t_ns - report.t_capture_ns
    if age < -timing.clock_skew_ns:
        return Cause.REPORT_REJECTED, f"captured {-age / MS:.0f} ms in the future"
    return None


def is_late(report: PerceptionReport, t_ns: int, timing: GateTiming) -> bool:
    """Whether a result came too long after its frame to be flown by."""
    return t_ns - report.t_capture_ns > timing.result_age_ns


def _implausibility(report: PerceptionReport) -> str | None:
    """Say which number of a report cannot be."""
    numbers = (*report.velocity, report.error_m, report.error_rad, report.overlap)
    if len(report.velocity) != 4 or not all(math.isfinite(n) for n in numbers):
        return "numbers that are not finite"
    if math.hypot(*report.velocity[:3]) > MAX_PLAUSIBLE_SPEED_M_S:
        return f"speed over {MAX_PLAUSIBLE_SPEED_M_S:g} m/s"
    if abs(report.velocity[3]) > MAX_PLAUSIBLE_YAW_RAD_S:
        return f"yaw rate over {MAX_PLAUSIBLE_YAW_RAD_S:g} rad/s"
    if report.error_m < 0 or report.error_rad < 0 or not 0 <= report.overlap <= 1:
        return "error or overlap out of range"
    if report.feature_error is not None and not 0 <= report.feature_error < math.inf:
        return "feature error out of range"
    if report.mounting_score is not None and not math.isfinite(report.mounting_score):
        return "mounting score out of range"
    return None


@dataclass(slots=True)
class PerceptionMonitor:
    """The last good report, since when all is good, and the last fault."""

    timing: GateTiming
    good: PerceptionReport | None = None
    good_since_ns: int | None = None
    reached_since_ns: int | None = None
    last_capture_ns: int = -1
    fault: Fault = (Cause.NO_DATA, "no report yet")
    """Why nothing may be flown by, where ``good`` is None."""
    overlap: float = 0.0
    lost: bool = False
    goal: str = ""
    """Digest of the goal that the operator commanded, empty for the one at the start."""
    arrivals: deque[tuple[int, int]] = field(default_factory=lambda: deque(maxlen=128))
    """When good reports arrived, and the times of capture, ns."""

    def set_goal(self, goal: str, fault: Fault) -> None:
        """Accept reports about this goal alone."""
        self.goal = goal
        self.overlap = 0.0
        self.lost = False
        self.invalidate(fault)

    def update(self, report: PerceptionReport, t_ns: int) -> Fault | None:
        """Check a report; a fault ends the good time.

        A repeated capture, or a late result, refreshes nothing: the last good frame counts for as
        long as its age allows.
        """
        is_for_goal = report.goal == self.goal
        fault = report_fault(report, t_ns, self.timing) if is_for_goal else _OTHER_GOAL
        self.lost = report.lost and is_for_goal
        if fault is not None:
            self.invalidate(fault)
            return fault
        if report.t_capture_ns <= self.last_capture_ns:
            return None
        if is_late(report, t_ns, self.timing):
            if self.good is None:
                age_ms = (t_ns - report.t_capture_ns) / MS
                self.fault = (Cause.RESULT_LATE, f"{age_ms:.0f} ms after capture")
            return None
        self.last_capture_ns = report.t_capture_ns
        self.arrivals.append((t_ns, report.t_capture_ns))
        self.good = report
        self.overlap = report.overlap
        self.good_since_ns = t_ns if self.good_since_ns is None else self.good_since_ns
        if not report.reached or report.goals_left:
            self.reached_since_ns = None
        elif self.reached_since_ns is None:
            self.reached_since_ns = t_ns
        return None

    def invalidate(self, fault: Fault) -> None:
        """Forget that data were good."""
        self.good = None
        self.good_since_ns = None
        self.reached_since_ns = None
        self.fault = fault

    def stale(self, now_ns: int) -> Fault | None:
        """Name why nothing may be flown by right now; what is too old is invalid for good."""
        if self.good is None:
            return self.fault
        age = now_ns - self.good.t_capture_ns
        if age <= self.timing.frame_age_ns:
            return None
        self.invalidate((Cause.FRAME_OLD, f"{age / MS:.0f} ms"))
        return self.fault

    def mounting_fault(self) -> Fault | None:
        """Whether the images turn about another axis than the vehicle does."""
        score = None if self.good is None else self.good.mounting_score
        if score is None or score > -MOUNTING_SCORE:
            return None
        detail = f"{-score:.0f} standard deviations; is it mounted as camera.mount says?"
        return Cause.WRONG_MOUNTING, detail

    def pace(self, now_ns: int) -> tuple[float, int]:
        """Good frames a second of late, and the median time from capture to report, ns."""
        recent = [t - capture for t, capture in self.arrivals if now_ns - t < PACE_NS]
        return len(recent) * S / PACE_NS, round(statistics.median(recent)) if recent else 0

    def replaced_age_ns(self, now_ns: int) -> int:
        """Median age of a good frame when the next result replaces it, of late, ns; 0: unknown.

        It is the period of the frames and the delay of the results together.
        """
        pairs = itertools.pairwise(self.arrivals)
        ages = [t - capture for (_, capture), (t, _) in pairs if now_ns - t < PACE_NS]
        return round(statistics.median(ages)) if ages else 0

    def lack_of_overlap(self, min_overlap: float) -> str:
        """How little of the goal is in view, as one line; empty where it is enough."""
        if self.overlap >= min_overlap:
            return ""
        lack = f"overlap {self.overlap:.0%}, {min_overlap:.0%} needed"
        place = "" if self.good is None else self.good.reason
        return f"{lack} ({place})" if place else lack

    @property
    def reason(self) -> str:
        """Last fault, as one line: why nothing may be flown by, where ``good`` is None."""
        cause, detail = self.fault
        return f"{cause}: {detail}" if detail else str(cause)

    def good_for_ns(self, now_ns: int) -> int:
        """Time for which data have been good without a break, -1 where they are not."""
        return -1 if self.good_since_ns is None else now_ns - self.good_since_ns

    @property
    def is_within_tolerance(self) -> bool:
        """Whether the last good frame shows its goal within tolerance, also on a route's way."""
        return self.good is not None and self.good.reached

    def reached_for_ns(self, now_ns: int) -> int:
        """Time for which every frame showed the last goal within tolerance, -1 where not."""
        return -1 if self.reached_since_ns is None else now_ns - self.reached_since_ns

    def velocity(self) -> BodyVelocity:
        """Velocity that the last good report asks for, zero where there is none."""
        return ZERO if self.good is None else BodyVelocity(*self.good.velocity)
