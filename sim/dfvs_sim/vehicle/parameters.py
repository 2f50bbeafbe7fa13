"""PX4's parameters: those that change how this vehicle behaves, with PX4's defaults and types.

On the wire an integer travels as its bytes inside the float field (bytewise encoding). An unknown
name is met with silence; every write is answered with the value that is now held.
"""

import functools
import math
import struct
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import development as mavlink

from dfvs_sim.dynamics.control import Gains

INT32, REAL32 = 6, 9
"""MAV_PARAM_TYPE of an integer and of a float."""

Value = int | float


@functools.cache
def default_parameters() -> Mapping[str, Value]:
    """PX4's defaults, by name in the order of their indices on the wire."""
    return tomllib.loads(Path(__file__).with_name("parameters.toml").read_text(encoding="utf-8"))


class ParameterTable(dict[str, Value]):
    """Values by name, with PX4's types; integers and floats never change into each other."""

    def __init__(self, changes: Mapping[str, Value] | None = None) -> None:
        super().__init__(default_parameters())
        for name, value in (changes or {}).items():
            self[name] = type(self[name])(value)
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
