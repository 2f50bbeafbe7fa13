"""What is wrong from the start: the goal, the mounting, the settings."""

import bisect
import math
import subprocess
import sys
import time

import numpy as np

from dfvs_core.gate.events import Action
from dfvs_core.gate.states import GateState
from dfvs_core.messages.goal import Mount
from dfvs_robustness.faults.fault import Inject
from dfvs_robustness.harness.harness import Harness
from dfvs_robustness.harness.records import Event
from dfvs_robustness.harness.service import HarnessError, wait_for_first, wait_until
from dfvs_robustness.harness.setup import NO_RESPONSE_CHECK, Setup

S = GateState
_MOVING_M_S = 0.01
_MOTION_S = 3.0
_CANNOT_RUN = 2
_TYPO_S = 20.0
_TRAVEL_M, _TRAVEL_S = 0.5, 8.0
_ENGAGED_S = 8.0
_AT_GOAL_S = 6.0


def _ordered(harness: Harness, _: np.random.Generator) -> int:
    """Command to engage although the checks do not pass."""
    harness.operator.command(Action.ENGAGE)
    return time.monotonic_ns()


def _frozen_view(harness: Harness, _: np.random.Generator) -> int:
    """However the vehicle flies, the view stays as it is."""
    harness.environment.pin()
    return time.monotonic_ns()


def _poses(harness: Harness, since_ns: int) -> list[Event]:
    """Poses of the vehicle, by the truth, since a time."""
    events = harness.environment.events
    first = bisect.bisect_left(events, since_ns, key=lambda e: int(e["t_ns"]))
    return [e for e in events[first:] if e["kind"] == "pose"]


def _initial_motion(harness: Harness, _: np.random.Generator) -> int:
    """When the vehicle itself, by the truth, began to move in SERVO, or an earlier ABORT."""
    harness.await_state(S.SERVO, S.ABORT)
    since_ns = _entered_ns(harness, S.SERVO)

    def begun() -> list[int]:
        poses = _poses(harness, since_ns)
        moving = [e["t_ns"] for e in poses if math.hypot(*e["velocity"]) >= _MOVING_M_S]
        log = harness.service.log.transitions(since_ns)
        return sorted(moving[:1] + [t["t_ns"] for t in log if t["target"] == S.ABORT])

    return wait_for_first(begun, _MOTION_S, "the vehicle does not move")


def _entered_ns(harness: Harness, state: GateState) -> int:
    """When the gate entered a state last."""
    entered = [t["t_ns"] for t in harness.service.log.transitions() if t["target"] == state]
    return int(entered[-1])


def _flown_far(harness: Harness, _: np.random.Generator) -> int:
    """When the vehicle itself, by the truth, was further from its start than it may be."""
    engaged_ns = _entered_ns(harness, S.ENGAGE)
    start = _poses(harness, engaged_ns)[0]["place"]

    def beyond() -> list[int]:
        poses = _poses(harness, engaged_ns)
        return [e["t_ns"] for e in poses if math.dist(e["place"], start) > _TRAVEL_M]

    return wait_for_first(beyond, _TRAVEL_S, f"the vehicle does not fly {_TRAVEL_M} m")


def _flown_long(harness: Harness, _: np.random.Generator) -> int:
    """When the gate has been engaged for as long as it may be."""
    end_ns = _entered_ns(harness, S.ENGAGE) + int(_ENGAGED_S * 1e9)
    wait_until(lambda: time.monotonic_ns() >= end_ns, _ENGAGED_S)
    return end_ns


def _held_long(harness: Harness, _: np.random.Generator) -> int:
    """When the goal has been held by vision for as long as it may be."""
    end_ns = _entered_ns(harness, S.DONE) + int(_AT_GOAL_S * 1e9)
    wait_until(lambda: time.monotonic_ns() >= end_ns, _AT_GOAL_S)
    return end_ns


def _misspelt(harness: Harness, _: np.random.Generator) -> int:
    """Start a second service with a setting that does not exist."""
    t_ns = time.monotonic_ns()
    words = [*harness.words(), "--set", "gate.hold_seconds=3"]
    command = [sys.executable, "-m", "dfvs_service.cli", *words]
    result = subprocess.run(command, capture_output=True, timeout=_TYPO_S, check=False)
    told = result.stderr.decode(errors="replace").strip().splitlines()
    if result.returncode != _CANNOT_RUN or len(told) != 1 or "hold_s" not in told[0]:
        raise HarnessError(f"the typo gave exit code {result.returncode} and {told[-1:]}")
    return t_ns


START_FAULTS: dict[str, Inject] = {
    "wrong-goal": _ordered,
    "unreachable-goal": _frozen_view,
    "wrong-mount": _initial_motion,
    "sideways-mount": _initial_motion,
    "flies-too-far": _flown_far,
    "flies-too-long": _flown_long,
    "holds-too-long": _held_long,
    "config-typo": _misspelt,
}

SETUPS = {
    "wrong-goal": Setup("classical", other_goal=True),
    "unreachable-goal": Setup(settings=(NO_RESPONSE_CHECK,)),
    "wrong-mount": Setup(mount=Mount(yaw_rad=math.pi)),
    "sideways-mount": Setup(mount=Mount(yaw_rad=math.pi / 2)),
    "flies-too-far": Setup(settings=(f"limits.max_distance_m={_TRAVEL_M}",)),
    "flies-too-long": Setup(settings=(f"limits.max_engaged_s={_ENGAGED_S}",)),
    "holds-too-long": Setup(settings=(f"gate.hold_visual_s={_AT_GOAL_S}",)),
}
"""What is wrong from the start.

A case of a turned mounting begins before SERVO, where the tilt may tell before the vehicle moves.
Every such case has a fresh service: the vehicle that is put elsewhere between two cases would turn
without its gyroscopes. The limit of ``unreachable-goal`` is five seconds after the last fall, which
may come after the view froze: the vehicle still tilts and turns, so that the view, levelled by its
attitude, comes nearer once or twice at first.
"""
