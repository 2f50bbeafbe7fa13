"""PARAM_REQUEST_READ, PARAM_REQUEST_LIST and PARAM_SET, answered as PX4 does.

An unknown name is met with silence; every write is answered with the value that is now held.
"""

from pymavlink.dialects.v20 import development as mavlink

from dfvs_sim.vehicle.messages.telemetry import Message
from dfvs_sim.vehicle.parameters import ParameterTable


def value_message(table: ParameterTable, name: str) -> Message:
    """PARAM_VALUE of a known parameter."""
    return mavlink.MAVLink_param_value_message(
        name.encode(), table.on_wire(name), table.kind(name), len(table), table.names.index(name)
    )


def read(table: ParameterTable, message: Message) -> list[Message]:
    """Answer PARAM_REQUEST_READ, by index where that is not negative, else by name."""
    name, index = message.param_id, message.param_index
    if index >= 0:
        name = table.names[index] if index < len(table) else ""
    return [value_message(table, name)] if name in table else []


def write(table: ParameterTable, message: Message) -> list[Message]:
    """Answer PARAM_SET; a wrong type or a value not finite changes nothing."""
    table.set_from_wire(message.param_id, message.param_value, message.param_type)
    return [value_message(table, message.param_id)] if message.param_id in table else []
