"""MAV_CMD_INJECT_FAILURE: faults on demand, as PX4's simulation offers them.

``SYS_FAILURE_EN`` must be 1. Three of PX4's units are known here. OFF empties the battery. GPS OFF
ends the position estimate, and WRONG shifts it by 2 m to the north. OFF of the MAVLink signal
silences a link in both directions (instance 1 companion, 2 ground station, 0 both). OK repairs
each, but takes back no shift.
"""

import math
from collections.abc import Mapping

from pymavlink.dialects.v20 import development as mavlink

from dfvs_sim.vehicle.messages.streams import COMPANION, GROUND, LinkState
from dfvs_sim.vehicle.motion.flight import Flight
from dfvs_sim.vehicle.status import Status

_OK, _OFF, _WRONG = 0, 1, 4
_EMPTY = 0.04
_JUMP_M = 2.0
_INSTANCES = {0: (COMPANION, GROUND), 1: (COMPANION,), 2: (GROUND,)}


def inject(
    params: tuple[float, ...], status: Status, flight: Flight, links: Mapping[str, LinkState]
) -> bool:
    """Apply (unit, type, instance); False where that combination is not known."""
    if not all(math.isfinite(p) for p in params[:3]):
        return False
    unit, kind, instance = (int(p) for p in params[:3])
    if unit == mavlink.FAILURE_UNIT_SYSTEM_BATTERY and kind in (_OK, _OFF):
        status.battery = _EMPTY if kind == _OFF else 1.0
        return True
    if unit == mavlink.FAILURE_UNIT_SENSOR_GPS and kind in (_OK, _OFF):
        flight.estimate.valid = kind == _OK
        return True
    if unit == mavlink.FAILURE_UNIT_SENSOR_GPS and kind == _WRONG:
        flight.estimator.reset_position(_JUMP_M, 0.0, 0.0)
        return True
    if unit == mavlink.FAILURE_UNIT_SYSTEM_MAVLINK_SIGNAL and kind in (_OK, _OFF):
        for name in _INSTANCES.get(instance, ()):
            links[name].dropped = kind == _OFF
        return instance in _INSTANCES
    return False
