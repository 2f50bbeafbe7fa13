"""PX4's parameters: those that change how this vehicle behaves, with PX4's defaults and types.

On the wire an integer travels as its bytes inside the float field (bytewise encoding). An unknown
name is met with silence; every write is answered with the value that is now held.
"""

import math
import struct
from collections.abc import Mapping
from typing import Any

from pymavlink.dialects.v20 import development as mavlink

from dfvs_sim.dynamics.control import Gains

INT32, REAL32 = 6, 9
"""MAV_PARAM_TYPE of an integer and of a float."""

Value = int | float

DEFAULTS: Mapping[str, Value] = {
    "COM_ARM_WO_GPS": 1,
    "COM_DISARM_LAND": 2.0,
    "COM_DISARM_PRFLT": 10.0,
    "COM_OBL_RC_ACT": 0,
    "COM_OF_LOSS_T": 1.0,
    "COM_RC_IN_MODE": 3,
    "COM_RC_LOSS_T": 0.5,
    "COM_SPOOLUP_TIME": 1.0,
    "MAV_COMP_ID": 1,
    "MAV_SYS_ID": 1,
    "MAV_TYPE": 2,
    "MC_YAWRATE_MAX": 200.0,
    "MC_YAW_P": 2.8,
    "MIS_TAKEOFF_ALT": 2.5,
    "MPC_ACC_HOR": 3.0,
    "MPC_JERK_AUTO": 4.0,
    "MPC_LAND_ALT1": 10.0,
    "MPC_LAND_ALT2": 5.0,
    "MPC_LAND_ALT3": 1.0,
    "MPC_LAND_CRWL": 0.3,
    "MPC_LAND_SPEED": 0.7,
    "MPC_MAN_TILT_MAX": 35.0,
    "MPC_MAN_Y_MAX": 150.0,
    "MPC_TILTMAX_AIR": 45.0,
    "MPC_TKO_RAMP_T": 3.0,
    "MPC_TKO_SPEED": 1.5,
    "MPC_VEL_MANUAL": 10.0,
    "MPC_XY_CRUISE": 5.0,
    "MPC_XY_P": 0.95,
    "MPC_XY_VEL_D_ACC": 0.2,
    "MPC_XY_VEL_I_ACC": 0.4,
    "MPC_XY_VEL_MAX": 12.0,
    "MPC_XY_VEL_P_ACC": 1.8,
    "MPC_Z_P": 1.0,
    "MPC_Z_VEL_I_ACC": 2.0,
    "MPC_Z_VEL_MAX_DN": 1.5,
    "MPC_Z_VEL_MAX_UP": 3.0,
    "MPC_Z_V_AUTO_DN": 1.5,
    "MPC_Z_V_AUTO_UP": 3.0,
    "NAV_MC_ALT_RAD": 0.8,
    "NAV_RCL_ACT": 2,
    "RTL_DESCEND_ALT": 30.0,
    "RTL_MIN_DIST": 10.0,
    "RTL_RETURN_ALT": 60.0,
    "SYS_AUTOSTART": 10040,
    "SYS_FAILURE_EN": 0,
}


class ParameterTable(dict[str, Value]):
    """Values by name, with PX4's types; integers and floats never change into each other."""

    def __init__(self, changes: Mapping[str, Value] | None = None) -> None:
        changed = {n: type(DEFAULTS[n])(value) for n, value in (changes or {}).items()}
        super().__init__(sorted({**DEFAULTS, **changed}.items()))
        self.names: tuple[str, ...] = tuple(self)

    def value_message(self, name: str) -> Any:
        """PARAM_VALUE of a known parameter."""
        value, kind = self[name], self._kind(name)
        if kind == INT32:
            value = struct.unpack("<f", struct.pack("<i", value))[0]
        return mavlink.MAVLink_param_value_message(
            name.encode(), value, kind, len(self), self.names.index(name)
        )

    def read(self, message: Any) -> list[Any]:
        """Answer PARAM_REQUEST_READ, by index where that is not negative, else by name."""
        name, index = message.param_id, message.param_index
        if index >= 0:
            name = self.names[index] if index < len(self) else ""
        return [self.value_message(name)] if name in self else []

    def write(self, message: Any) -> list[Any]:
        """Answer PARAM_SET; a wrong type or a value not finite changes nothing."""
        name, value = message.param_id, message.param_value
        if name not in self:
            return []
        if message.param_type == self._kind(name) == INT32:
            self[name] = struct.unpack("<i", struct.pack("<f", value))[0]
        elif message.param_type == self._kind(name) and math.isfinite(value):
            self[name] = value
        return [self.value_message(name)]

    def _kind(self, name: str) -> int:
        """MAV_PARAM_TYPE of a known parameter."""
        return INT32 if isinstance(self[name], int) else REAL32

    def gains(self) -> Gains:
        """Gains and limits of the position and velocity loops."""
        return Gains(
            xy_position=self["MPC_XY_P"],
            z_position=self["MPC_Z_P"],
            xy_velocity=self["MPC_XY_VEL_P_ACC"],
            xy_integral=self["MPC_XY_VEL_I_ACC"],
            xy_derivative=self["MPC_XY_VEL_D_ACC"],
            z_integral=self["MPC_Z_VEL_I_ACC"],
            yaw=self["MC_YAW_P"],
            speed_xy_m_s=self["MPC_XY_VEL_MAX"],
            speed_up_m_s=self["MPC_Z_VEL_MAX_UP"],
            speed_down_m_s=self["MPC_Z_VEL_MAX_DN"],
            tilt_max_rad=math.radians(self["MPC_TILTMAX_AIR"]),
            yaw_rate_max_rad_s=math.radians(self["MC_YAWRATE_MAX"]),
        )
