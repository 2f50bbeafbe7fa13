"""Reading and writing the autopilot's parameters over the ground-station link."""

import struct

from pymavlink.dialects.v20 import development as mavlink

from dfvs_sim.ground.link import GroundLink, Message
from dfvs_sim.ground.systems import LinkError

_TIMEOUT_S, _RETRIES = 0.7, 3
_REAL32 = mavlink.MAV_PARAM_TYPE_REAL32


def get_parameter(link: GroundLink, name: str) -> int | float:
    """Value of a parameter, an int or a float as PX4 holds it.

    Raises
    ------
    LinkError
        If the vehicle stays silent, as PX4 does for an unknown name.
    """
    request = mavlink.MAVLink_param_request_read_message(link.target, 1, name.encode(), -1)
    return _exchange(link, name, request)


def set_parameter(link: GroundLink, name: str, value: float) -> None:
    """Write a parameter in its own type, and check what the vehicle took.

    Raises
    ------
    LinkError
        If the vehicle stays silent or keeps another value.
    """
    integer = isinstance(get_parameter(link, name), int)
    wire = struct.unpack("<f", struct.pack("<i" if integer else "<f", value))[0]
    kind = mavlink.MAV_PARAM_TYPE_INT32 if integer else _REAL32
    request = mavlink.MAVLink_param_set_message(link.target, 1, name.encode(), wire, kind)
    taken = _exchange(link, name, request)
    if abs(taken - value) > 1e-6 * max(1.0, abs(value)):
        raise LinkError(f"the vehicle keeps {name} = {taken}", f"{value}")


def _exchange(link: GroundLink, name: str, request: Message) -> int | float:
    """Send the request until PARAM_VALUE of that name comes back."""
    values: list[Message] = []

    def keep(message: Message, _: int) -> None:
        if message.param_id == name:
            values.append(message)

    end = link.subscribe(["PARAM_VALUE"], keep)
    try:
        for _ in range(_RETRIES):
            link.send(request)
            link.wait_for("PARAM_VALUE", _TIMEOUT_S, lambda m: m.param_id == name and bool(values))
            if values:
                return _decoded(values[-1])
    finally:
        end()
    raise LinkError(f"the vehicle does not answer for parameter {name}", "a known parameter")


def _decoded(message: Message) -> int | float:
    if message.param_type == _REAL32:
        return float(message.param_value)
    return int(struct.unpack("<i", struct.pack("<f", message.param_value))[0])
