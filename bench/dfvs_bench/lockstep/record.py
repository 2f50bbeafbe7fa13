"""What a flight in simulated time amounts to, and flights together."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dfvs_bench.lockstep.flight import LockstepLog, Sample
from dfvs_bench.trials.statistics import largest, mean, settled_index
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.servo.exchange import Status
from dfvs_sim.demo.flight.track import CONVERGED_M, CONVERGED_RAD, meets_criterion

FALSE_DONE_M, FALSE_DONE_DEG = 3.0 * CONVERGED_M, 3.0 * math.degrees(CONVERGED_RAD)
DISTANCE_FROM_M = 1.0
"""Path after which the distance to the goal is compared with the truth."""
_LEAST_DISTANCE_M = 0.1
"""Distance to the goal below which its relative error says nothing."""

_FALSE_ALARMS = ("camera turns another way", "error does not fall", "goal lost")


@dataclass(frozen=True, slots=True)
class SimulatedFlight:
    """One flight; distances in m, angles in degrees, times in s since the release to servo.

    ``start_m`` is the distance to the goal at the release, None where there was none. ``moved_m``
    is how far the camera had moved when the flight ended. ``hold_rms_m`` and
    ``hold_heading_rms_deg`` are of the time after DONE. ``distance_error`` are the logarithms of
    estimated over true distance after ``DISTANCE_FROM_M`` of path and 10 cm or more from the goal,
    and ``distance_spread`` what was stated for them.
    """

    seed: int
    end_state: str
    end_cause: str
    start_m: float | None
    end_s: float | None
    within_s: float | None
    moved_m: float
    hold_rms_m: float | None
    hold_heading_rms_deg: float | None
    farthest_m: float
    distance_error: tuple[float, ...]
    distance_spread: tuple[float, ...]

    @property
    def is_false_alarm(self) -> bool:
        """Whether a check ended it."""
        return self.end_state == "ABORT" and self.end_cause.startswith(_FALSE_ALARMS)

    @property
    def is_false_done(self) -> bool:
        """Whether it said DONE and was three tolerances from the goal or more, in rms."""
        away = (self.hold_rms_m or 0.0, self.hold_heading_rms_deg or 0.0)
        return away[0] >= FALSE_DONE_M or away[1] >= FALSE_DONE_DEG


def simulated_flight(seed: int, T_scene_goal: FloatArray, log: LockstepLog) -> SimulatedFlight:
    """Figures of a flight that has ended; by the true pose."""
    flown = list(itertools.dropwhile(lambda s: s.state != "SERVO", log.samples))
    end, last = log.end, log.last_end
    end_s = None if end is None or log.engaged_ns is None else (end.t_ns - log.engaged_ns) * 1e-9
    held = [s for s in flown if s.state == "DONE"]
    errors, spreads = _distance_errors(flown)
    return SimulatedFlight(
        seed=seed,
        end_state=log.samples[-1].state if last is None else str(last.target),
        end_cause="" if last is None else last.reason,
        start_m=flown[0].error_m if flown else None,
        end_s=end_s,
        within_s=_within_s(flown),
        moved_m=_moved_m(flown, end_s),
        hold_rms_m=_rms([s.error_m for s in held]),
        hold_heading_rms_deg=_rms([_heading_error_deg(s, T_scene_goal) for s in held]),
        farthest_m=max((s.error_m for s in flown), default=0.0),
        distance_error=tuple(errors),
        distance_spread=tuple(spreads),
    )


def _within_s(samples: Sequence[Sample]) -> float | None:
    """Time after which the error stays within 5 cm and 1 degree, None if it does not."""
    first = settled_index([meets_criterion(s.error_m, s.error_rad) for s in samples])
    return None if first is None else samples[first].t_s


def _moved_m(samples: Sequence[Sample], end_s: float | None) -> float:
    """Farthest that the camera was from where it was released, up to the end of the flight."""
    until = math.inf if end_s is None else end_s
    places = [s.T_scene_camera[:3, 3] for s in samples if s.t_s <= until]
    return max((float(np.linalg.norm(place - places[0])) for place in places), default=0.0)


def _rms(values: Sequence[float]) -> float | None:
    return float(np.sqrt(np.mean(np.square(values)))) if values else None


def _heading_error_deg(sample: Sample, T_scene_goal: FloatArray) -> float:
    headings = [math.atan2(T[1, 2], T[0, 2]) for T in (sample.T_scene_camera, T_scene_goal)]
    return math.degrees(math.remainder(headings[0] - headings[1], math.tau))


def _distance_errors(samples: Sequence[Sample]) -> tuple[list[float], list[float]]:
    """Logarithms of estimated over true distance after the first metre, and their spreads."""
    errors, spreads = [], []
    way_m, last = 0.0, None
    for s in samples:
        position = s.T_scene_camera[:3, 3]
        way_m += 0.0 if last is None else float(np.linalg.norm(position - last))
        last = position
        result = s.result
        if result is None or result.status is not Status.OK or result.uncertainty is None:
            continue
        if way_m >= DISTANCE_FROM_M and s.error_m >= _LEAST_DISTANCE_M and result.error_m > 0.0:
            errors.append(math.log(result.error_m / s.error_m))
            spreads.append(result.uncertainty.error_m / result.error_m)
    return errors, spreads


def summarise(flights: Sequence[SimulatedFlight]) -> dict[str, Any]:
    """Summary of flights, as JSON can hold it."""
    done = [f for f in flights if f.end_state == "DONE"]
    errors = np.array([e for f in flights for e in f.distance_error])
    spreads = np.array([s for f in flights for s in f.distance_spread])
    relative = np.abs(np.exp(errors) - 1.0)
    held = [f.hold_rms_m for f in done if f.hold_rms_m is not None]
    return {
        "flights": len(flights),
        "done": len(done),
        "false_done": sum(f.is_false_done for f in flights),
        "false_alarms": sum(f.is_false_alarm for f in flights),
        "other_ends": sorted(
            {f.end_cause for f in flights if f.end_cause and f.end_state != "DONE"}
        ),
        "mean_done_s": mean([f.end_s for f in done]),
        "mean_within_s": mean([f.within_s for f in done]),
        "longest_end_s": largest([f.end_s for f in flights]),
        "longest_way_m": largest([f.moved_m for f in flights]),
        "farthest_m": largest([f.farthest_m for f in flights]),
        "hold_rms_m": _rms(held),
        "worst_hold_rms_m": largest(held),
        "worst_hold_heading_deg": largest([f.hold_heading_rms_deg for f in done]),
        "distance_from_m": DISTANCE_FROM_M,
        "distance_frames": len(errors),
        "distance_flights": sum(bool(f.distance_error) for f in flights),
        "distance_error_median": float(np.median(relative)) if len(relative) else None,
        "distance_error_95": float(np.percentile(relative, 95)) if len(relative) else None,
        "within_stated_1_sigma": _share(np.abs(errors) <= spreads),
        "within_stated_2_sigma": _share(np.abs(errors) <= 2.0 * spreads),
    }


def _share(inside: FloatArray) -> float | None:
    return float(np.mean(inside)) if len(inside) else None
