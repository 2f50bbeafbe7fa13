"""Whatever arrives, the vehicle neither falls over nor sends numbers that are no numbers."""

import math
from contextlib import closing
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import development as mavlink
from vehicle_in_hand import hovering, in_offboard, setpoint

from dfvs_sim.vehicle.messages.streams import COMPANION, GROUND
from dfvs_sim.vehicle.messages.udp_link import UdpLink, UdpPorts
from dfvs_sim.vehicle.modes import Mode
from dfvs_sim.vehicle.parameters import default_parameters

HANDLED = (
    "HEARTBEAT",
    "SET_POSITION_TARGET_LOCAL_NED",
    "MANUAL_CONTROL",
    "SET_MODE",
    "COMMAND_LONG",
    "COMMAND_INT",
    "PARAM_REQUEST_READ",
    "PARAM_REQUEST_LIST",
    "PARAM_SET",
    "PING",
    "TIMESYNC",
)
COMMANDS = (20, 21, 22, 176, 400, 410, 420, 510, 511, 512, 520, 31010)
TARGETS = ("target", "target_system", "target_component")


def hostile_value(kind: str, rng: np.random.Generator) -> Any:
    if kind == "char":
        return bytes(rng.integers(0, 256, 16, dtype=np.uint8))
    if kind in ("float", "double"):
        extremes = (math.nan, math.inf, -math.inf, 3e38, -3e38, 0.0, 1.0, -1.0, 4.0, 6.0, 32.0)
        return float(rng.choice(extremes))
    bits = int("".join(c for c in kind if c.isdigit()))
    low, high = (0, 2**bits) if kind.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1))
    choices = (low, high - 1, int(rng.integers(low, min(high, 2**62))))
    return choices[int(rng.integers(3))]


def hostile_message(rng: np.random.Generator) -> Any:
    name = str(rng.choice(HANDLED))
    kinds = {k.msgname: k for k in mavlink.mavlink_map.values()}
    kind = kinds[name]
    fields: dict[str, Any] = {}
    for field, type_name in zip(kind.fieldnames, kind.fieldtypes, strict=True):
        base = type_name.removesuffix("_t")
        fields[field] = int(rng.integers(0, 2)) if field in TARGETS else hostile_value(base, rng)
        if field == "command":
            fields[field] = int(rng.choice(COMMANDS))
        if field == "param_id" and rng.random() < 0.7:
            fields[field] = str(rng.choice(list(default_parameters()))).encode()
        if field == "param_type":
            fields[field] = int(rng.choice([6, 9]))
        if field == "coordinate_frame":
            fields[field] = int(rng.choice([1, 8, 3]))
    return kind(**fields)


def test_a_storm_of_hostile_messages_is_survived(rng: np.random.Generator) -> None:
    vehicle = hovering(parameters={"SYS_FAILURE_EN": 1})
    sender = mavlink.MAVLink(None, 1, 195)
    receiver = mavlink.MAVLink(None)
    receiver.robust_parsing = True
    for i in range(3000):
        packed = hostile_message(rng).pack(sender)
        for message in receiver.parse_buffer(packed) or ():
            if message.get_type() != "BAD_DATA":
                link = COMPANION if i % 2 else GROUND
                for answer in vehicle.px4.handle(message, link, vehicle.now_ns):
                    answer.pack(sender)
        vehicle.now_ns += 8_000_000
        for _, answer in vehicle.px4.step(vehicle.now_ns):
            answer.pack(sender)
    body = vehicle.body
    assert all(map(math.isfinite, (body.north_m, body.east_m, body.down_m, body.yaw_rad)))


def test_after_extreme_setpoints_it_still_flies() -> None:
    vehicle = in_offboard(setpoint(vx=3e38, vy=-3e38, vz=-3e38, yaw_rate=3e38), 2.0)
    vehicle.run(1.0, setpoint(frame=1, mask=0x9C7, yaw=3e38))
    vehicle.set_mode(Mode.HOLD)
    vehicle.run(12.0)
    speed = math.hypot(vehicle.body.v_north_m_s, vehicle.body.v_east_m_s, vehicle.body.v_down_m_s)
    assert speed < 0.1


def test_damaged_bytes_on_the_socket_are_skipped(rng: np.random.Generator) -> None:
    packed = setpoint(vx=0.5).pack(mavlink.MAVLink(None, 1, 195))
    with (
        closing(UdpLink("one", UdpPorts(0, 9))) as link,
        closing(UdpLink("two", UdpPorts(0, 9))) as peer,
    ):
        address = ("127.0.0.1", link.port)
        for _ in range(200):
            noise = bytes(rng.integers(0, 256, int(rng.integers(1, 60)), dtype=np.uint8))
            cut = packed[: int(rng.integers(1, len(packed)))]
            peer.socket.sendto(noise, address)
            peer.socket.sendto(cut, address)
            link.receive()
        for _ in range(20):  # a damaged length byte may swallow the packets after it
            peer.socket.sendto(packed, address)
        kinds = [m.get_type() for m in link.receive()]
    assert "SET_POSITION_TARGET_LOCAL_NED" in kinds
