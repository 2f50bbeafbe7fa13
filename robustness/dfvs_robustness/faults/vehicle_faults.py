"""Faults of the vehicle, its link and its pilot."""

import time
from collections.abc import Sequence

import numpy as np
from pymavlink.dialects.v20 import development as mavlink

from dfvs_robustness.faults.fault import Inject
from dfvs_robustness.harness.environment import BATTERY, GPS
from dfvs_robustness.harness.harness import Harness
from dfvs_robustness.harness.records import MODE_REPORTS
from dfvs_robustness.harness.service import wait_for_first
from dfvs_sim.vehicle.modes import Mode
from dfvs_sim.vehicle.px4 import Px4

MS = 1_000_000
_HEARTBEAT_S = 1.5
_OFF, _WRONG = mavlink.FAILURE_TYPE_OFF, mavlink.FAILURE_TYPE_WRONG
_STICKS_NS = 10_000 * MS


def _heartbeat_lost(harness: Harness, _: np.random.Generator) -> int:
    harness.environment.stream("HEARTBEAT", -1.0)
    return int(harness.environment.last("heartbeat_sent")["t_ns"])


def _next_sent(harness: Harness, since_ns: int, kinds: Sequence[str]) -> int:
    """When the first message of these kinds after a time was sent."""

    def found() -> list[int]:
        recent = harness.environment.events[-3000:]
        return [e["t_ns"] for e in recent if e["kind"] in kinds and e["t_ns"] > since_ns]

    return wait_for_first(found, _HEARTBEAT_S, f"none of {kinds} is sent")


def _taken_over(harness: Harness, rng: np.random.Generator) -> int:
    modes = [Mode.LAND, Mode.RETURN, Mode.ALTITUDE, Mode.STABILIZED, Mode.POSITION, Mode.HOLD]
    which = int(rng.integers(len(modes)))

    def take(px4: Px4, now_ns: int) -> int:
        # Who selects the mode that is on already changes nothing that anybody could see.
        others = [mode for mode in modes if mode is not px4.status.mode]
        mode = others[which % len(others)]
        px4.status.manual_ns = now_ns + _STICKS_NS  # sticks are held from now on
        px4.request_mode(mode, now_ns)
        return time.monotonic_ns()

    return _next_sent(harness, harness.environment.do(take), MODE_REPORTS)


def _disarmed(harness: Harness, _: np.random.Generator) -> int:
    since_ns = time.monotonic_ns()
    harness.environment.do(lambda px4, now_ns: px4.disarm(now_ns, "kill switch", force=True))
    return _next_sent(harness, since_ns, ("heartbeat_sent",))


def _injected(unit: int, kind: int) -> Inject:
    return lambda harness, _: harness.environment.inject(unit, kind)


VEHICLE_FAULTS: dict[str, Inject] = {
    "link-lost": lambda harness, _: harness.environment.silence(),
    "heartbeat-lost": _heartbeat_lost,
    "takeover": _taken_over,
    "disarmed": _disarmed,
    "estimator-invalid": _injected(GPS, _OFF),
    "estimator-jumps": _injected(GPS, _WRONG),
    "battery-low": _injected(BATTERY, _OFF),
}
