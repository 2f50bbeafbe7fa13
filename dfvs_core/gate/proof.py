"""Proof of the first second: moving slowly, the error must fall.

A camera mounted the wrong way round, a flipped axis or a wrong goal make the law push away from
the goal. So the vehicle first moves at a crawl, and flies on only if the error fell while it
did. An error that rose for certain ends the flight after a second; one that has hardly changed,
because the vehicle answers late, gets two more seconds at a crawl. Errors are compared as medians
of a few reports, since a single one is noisy.
"""

from __future__ import annotations

import statistics
from dataclasses import dataclass, field

from dfvs_core.gate.limits import BodyVelocity
from dfvs_core.wire.link import PerceptionReport

MIN_PATH_M = 0.03
MIN_TURN_RAD = 0.05
"""Commanded motion below which the error need not show a change: the goal is near already."""

_CERTAIN_RISE = 0.08
"""A larger rise, relative to the first error, is no noise: the motion goes the wrong way."""

_MEDIAN_OF = 5
_MIN_REPORTS = 4


@dataclass(slots=True)
class MotionProof:
    """Errors seen and motion commanded since the vehicle began to move."""

    start_ns: int
    errors: list[tuple[float, float, float | None]] = field(default_factory=list)
    path_m: float = 0.0
    turn_rad: float = 0.0

    def see(self, report: PerceptionReport) -> None:
        """Take the errors of a good report."""
        self.errors.append((report.error_m, report.error_rad, report.feature_error))

    def move(self, setpoint: BodyVelocity, dt_s: float) -> None:
        """Count the motion that a setpoint asks for during ``dt_s``."""
        self.path_m += setpoint.speed_m_s * dt_s
        self.turn_rad += abs(setpoint.yaw_rad_s) * dt_s

    def objection(self) -> str | None:
        """Say which error did not fall although the vehicle was told to move."""
        return self._verdict(rise=0.0)

    def is_open(self) -> bool:
        """Tell whether no error has risen for certain: the vehicle has hardly moved yet."""
        return len(self.errors) >= _MIN_REPORTS and self._verdict(rise=_CERTAIN_RISE) is None

    def _verdict(self, rise: float) -> str | None:
        """Name the error whose change is more than ``rise`` of what it was at first."""
        if len(self.errors) < _MIN_REPORTS:
            return f"only {len(self.errors)} reports to judge by"
        moved, turned = self.path_m >= MIN_PATH_M, self.turn_rad >= MIN_TURN_RAD
        features = [e[2] for e in self.errors if e[2] is not None]
        if len(features) == len(self.errors):
            return _not_falling("feature error", features, rise) if moved or turned else None
        if moved and (text := _not_falling("distance", [e[0] for e in self.errors], rise)):
            return text
        return _not_falling("angle", [e[1] for e in self.errors], rise) if turned else None


def _not_falling(name: str, errors: list[float], rise: float) -> str | None:
    count = min(_MEDIAN_OF, len(errors) // 2)
    first, last = statistics.median(errors[:count]), statistics.median(errors[-count:])
    falls = last < first * (1.0 + rise)
    return None if falls else f"{name} went from {first:.4f} to {last:.4f}"
