"""The simulated vehicle, already hovering, with a pilot who obeys lines on standard input.

Take-off is computed ahead of real time, so that a test need not wait for it. Lines: ``mode NAME``,
``disarm``, ``mute`` (no more telemetry), ``battery SHARE``, ``parameter NAME VALUE``,
``intruder RIGHT`` (a ground station sends that body velocity, m/s, at 50 Hz over its own link).
Besides the vehicle's own record, every heartbeat that it sends is recorded.
"""

import argparse
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from pymavlink.dialects.v20 import development as mavlink

from dfvs_robustness.harness.records import mode_report
from dfvs_sim.vehicle.messages.streams import COMPANION, GROUND
from dfvs_sim.vehicle.messages.udp_link import UdpLink, UdpPorts, wait_for_data
from dfvs_sim.vehicle.modes import Mode
from dfvs_sim.vehicle.parameters import ParameterTable
from dfvs_sim.vehicle.px4 import STEP_NS, Px4, VehicleConfig
from dfvs_sim.vehicle.record import VehicleRecord

AHEAD_NS = 25_000_000_000
PARAMETERS = {"COM_OF_LOSS_T": 0.5, "COM_OBL_RC_ACT": 5}
INTRUDER_NS = 20_000_000


def take_off(px4: Px4, start_ns: int, end_ns: int) -> None:
    """Fly from the ground to a hover, as fast as it can be computed."""
    t_ns = start_ns
    asked = False
    while t_ns < end_ns:
        t_ns += STEP_NS
        px4.step(t_ns)
        if not asked and px4.status.ready and px4.arm(t_ns) is None:
            asked = True
            px4.request_mode(Mode.TAKEOFF, t_ns)
    if px4.status.mode is not Mode.HOLD or px4.status.landed:
        raise RuntimeError(f"not hovering: {px4.status}")


class Intruder:
    """A ground station that sends setpoints, once a velocity is set."""

    def __init__(self) -> None:
        self.right_m_s: float | None = None
        self._next_ns = 0

    def act(self, px4: Px4, now_ns: int) -> None:
        """Send the velocity at 50 Hz over the ground link."""
        if self.right_m_s is None or now_ns < self._next_ns:
            return
        self._next_ns = now_ns + INTRUDER_NS
        zeros = (0.0, 0.0, 0.0)
        velocity = (0.0, self.right_m_s, 0.0)
        message = mavlink.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, mavlink.MAV_FRAME_BODY_NED, 0x5C7, *zeros, *velocity, *zeros, 0.0, 0.0
        )
        message.pack(mavlink.MAVLink(None, 255, 190))
        px4.handle(message, GROUND, now_ns)


def obey(px4: Px4, intruder: Intruder, line: str, now_ns: int) -> bool:
    """Do what a line says; tells whether telemetry goes on."""
    word, *rest = line.split()
    if word == "mode":
        px4.request_mode(Mode[rest[0]], now_ns)
    elif word == "disarm":
        px4.disarm(now_ns, "test", force=True)
    elif word == "battery":
        px4.status.battery = float(rest[0])
    elif word == "parameter":
        wire = ParameterTable({rest[0]: float(rest[1])}).on_wire(rest[0])
        px4.parameters.set_from_wire(rest[0], wire, px4.parameters.kind(rest[0]))
    elif word == "intruder":
        intruder.right_m_s = float(rest[0])
    return word != "mute"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--record", type=Path, required=True)
    parser.add_argument("--on-ground", action="store_true")
    args = parser.parse_args()
    record = VehicleRecord(args.record)
    begin_ns = time.monotonic_ns() - AHEAD_NS
    journal: Callable[..., None] = record
    config = VehicleConfig(parameters=PARAMETERS)
    px4 = Px4(config, begin_ns, np.random.default_rng(1), journal)
    if not args.on_ground:
        take_off(px4, begin_ns, begin_ns + AHEAD_NS)
    link = UdpLink(COMPANION, UdpPorts(0, args.port))
    os.set_blocking(sys.stdin.fileno(), False)
    print("ready", flush=True)
    intruder = Intruder()
    speaks, next_ns = True, time.monotonic_ns()
    px4.step(next_ns)
    while True:
        wait_for_data([link], (next_ns - time.monotonic_ns()) / 1e9)
        now_ns = time.monotonic_ns()
        for message in link.receive():
            for answer in px4.handle(message, COMPANION, now_ns):
                link.send(answer)
        for line in sys.stdin.readlines():
            speaks = obey(px4, intruder, line, now_ns) and speaks
        if now_ns < next_ns:
            continue
        next_ns = max(next_ns + STEP_NS, now_ns)
        intruder.act(px4, now_ns)
        for name, message in px4.step(now_ns):
            if name == COMPANION and speaks:
                if (told := mode_report(message)) is not None:
                    record(time.monotonic_ns(), *told)
                link.send(message)


if __name__ == "__main__":
    main()
