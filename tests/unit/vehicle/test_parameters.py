"""PX4's parameters over MAVLink."""

import math
import struct

import pytest
from pymavlink.dialects.v20 import development as mavlink
from vehicle_in_hand import VehicleInHand, setpoint

INT32, REAL32 = mavlink.MAV_PARAM_TYPE_INT32, mavlink.MAV_PARAM_TYPE_REAL32


def as_float(value: int) -> float:
    return float(struct.unpack("<f", struct.pack("<i", value))[0])


def as_int(value: float) -> int:
    return int(struct.unpack("<i", struct.pack("<f", value))[0])


def read(name: str, index: int = -1) -> mavlink.MAVLink_message:
    return mavlink.MAVLink_param_request_read_message(1, 1, name.encode(), index)


def write(name: str, value: float, kind: int) -> mavlink.MAVLink_message:
    return mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, kind)


def decoded(message: mavlink.MAVLink_message) -> mavlink.MAVLink_message:
    """As the receiver of the packed message sees it."""
    packed = message.pack(mavlink.MAVLink(None, 1, 195))
    return mavlink.MAVLink(None).parse_buffer(packed)[0]


def test_px4s_defaults_for_offboard_loss() -> None:
    vehicle = VehicleInHand()
    (loss,) = vehicle.send(decoded(read("COM_OF_LOSS_T")))
    assert (loss.param_value, loss.param_type) == (1.0, REAL32)
    (action,) = vehicle.send(decoded(read("COM_OBL_RC_ACT")))
    assert (as_int(action.param_value), action.param_type) == (0, INT32)


def test_the_vehicle_s_own_number_is_a_parameter() -> None:
    vehicle = VehicleInHand(system_id=3)
    request = mavlink.MAVLink_param_request_read_message(3, 1, b"MAV_SYS_ID", -1)
    (number,) = vehicle.send(decoded(request))
    assert as_int(number.param_value) == 3


@pytest.mark.parametrize("value", [5, 0, -1, 123456, -(2**31)])
def test_an_integer_travels_as_its_bytes(value: int) -> None:
    vehicle = VehicleInHand()
    (answer,) = vehicle.send(decoded(write("COM_OBL_RC_ACT", as_float(value), INT32)))
    assert as_int(decoded(answer).param_value) == value
    assert vehicle.px4.parameters["COM_OBL_RC_ACT"] == value


def test_an_unknown_parameter_is_met_with_silence() -> None:
    vehicle = VehicleInHand()
    assert vehicle.send(read("NO_SUCH_THING")) == []
    assert vehicle.send(write("NO_SUCH_THING", 1.0, REAL32)) == []
    assert vehicle.send(read("", 9999)) == []


def test_another_type_or_a_nan_changes_nothing() -> None:
    vehicle = VehicleInHand()
    (answer,) = vehicle.send(write("COM_OF_LOSS_T", as_float(7), INT32))
    assert answer.param_value == 1.0
    (answer,) = vehicle.send(write("COM_OF_LOSS_T", math.nan, REAL32))
    assert answer.param_value == 1.0


def test_the_list_holds_every_parameter_once() -> None:
    vehicle = VehicleInHand()
    vehicle.send(mavlink.MAVLink_param_request_list_message(1, 1))
    vehicle.run(1.0)
    values = vehicle.received("PARAM_VALUE")
    assert [m.param_index for m in values] == list(range(values[0].param_count))
    assert len(values) == values[0].param_count


def test_a_written_limit_is_flown() -> None:
    vehicle = VehicleInHand()
    vehicle.send(write("MPC_XY_VEL_MAX", 0.5, REAL32))
    vehicle.fly_offboard(setpoint(vx=5.0), 8.0)
    assert 0.4 < vehicle.body.v_north_m_s < 0.55
