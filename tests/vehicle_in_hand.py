"""A simulated vehicle whose clock the test holds, and the messages to speak to it."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import development as mavlink

from dfvs_sim.vehicle.messages.earth import HOME_ALTITUDE_M
from dfvs_sim.vehicle.messages.streams import COMPANION, GROUND
from dfvs_sim.vehicle.modes import Mode
from dfvs_sim.vehicle.motion.flight import VehicleConfig
from dfvs_sim.vehicle.px4 import STEP_NS, Px4

START_NS = 1_000_000_000
BODY_VELOCITY = 0x5C7
ARM, SET_MODE, TAKEOFF, LAND = 400, 176, 22, 21
LATER = 20_000_000


def setpoint(
    vx: float = 0.0,
    vy: float = 0.0,
    vz: float = 0.0,
    yaw_rate: float = 0.0,
    *,
    frame: int = 8,
    mask: int = BODY_VELOCITY,
    yaw: float = 0.0,
) -> Any:
    """SET_POSITION_TARGET_LOCAL_NED with a velocity."""
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, frame, mask, 0, 0, 0, vx, vy, vz, 0, 0, 0, yaw, yaw_rate
    )


def sticks(forward: float = 0.0) -> Any:
    """MANUAL_CONTROL, in shares of full deflection; nothing up or down."""
    return mavlink.MAVLink_manual_control_message(1, round(1000 * forward), 0, 500, 0, 0)


def gcs_heartbeat() -> Any:
    return mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


class VehicleInHand:
    """Px4 with its sent messages and its record."""

    def __init__(self, *, seed: int = 3, **config: Any) -> None:
        self.now_ns = START_NS
        self.record: list[tuple[int, str, dict[str, Any]]] = []
        self.sent: list[tuple[int, str, Any]] = []
        self.px4 = Px4(
            VehicleConfig(**config),
            self.now_ns,
            np.random.default_rng(seed),
            lambda t_ns, kind, fields: self.record.append((t_ns, kind, fields)),
        )

    @property
    def mode(self) -> Mode:
        return self.px4.status.mode

    @property
    def body(self) -> Any:
        return self.px4.flight.vehicle

    def send(self, message: Any, link: str = COMPANION, component: int = 195) -> list[Any]:
        """Hand a message over; the answers that come at once."""
        message._header = mavlink.MAVLink_header(
            message.get_msgId(), srcSystem=1, srcComponent=component
        )
        return self.px4.handle(message, link, self.now_ns)

    def command(self, command: int, *params: float, link: str = COMPANION) -> list[int]:
        """Send COMMAND_LONG; results of all its acks within 20 ms."""
        padded = [*params, *[0.0] * (7 - len(params))]
        message = mavlink.MAVLink_command_long_message(1, 1, command, 0, *padded)
        answers = self.send(message, link)
        begin = len(self.sent)
        self.run(LATER / 1e9)
        answers += [m for _, name, m in self.sent[begin:] if name == link]
        return [m.result for m in answers if m.get_type() == "COMMAND_ACK" and m.command == command]

    def set_mode(self, mode: Mode) -> list[int]:
        return self.command(SET_MODE, 1.0, *mode.value)

    def run(self, seconds: float, message: Any = None, rate_hz: float = 20.0) -> None:
        """Let time pass, sending a message at a rate meanwhile."""
        end_ns, next_ns = self.now_ns + round(seconds * 1e9), self.now_ns
        while self.now_ns < end_ns:
            if message is not None and self.now_ns >= next_ns:
                self.send(message)
                next_ns += round(1e9 / rate_hz)
            self.now_ns += STEP_NS
            self.sent += [(self.now_ns, name, m) for name, m in self.px4.step(self.now_ns)]

    def run_until(self, condition: Callable[[], bool], limit_s: float) -> float:
        """Let time pass until the condition holds; the seconds that took."""
        begin_ns = self.now_ns
        while not condition():
            self.run(STEP_NS / 1e9)
            assert self.now_ns - begin_ns < limit_s * 1e9, f"not within {limit_s} s"
        return (self.now_ns - begin_ns) / 1e9

    def leaves_mode_within(self, mode: Mode, seconds: float) -> bool:
        """Let time pass; whether the mode was left meanwhile."""
        left = False
        for _ in range(round(seconds * 1e9 / STEP_NS)):
            self.run(STEP_NS / 1e9)
            left = left or self.mode is not mode
        return left

    def hear_ground_station(self) -> None:
        """A ground station's heartbeat on its link."""
        self.send(gcs_heartbeat(), GROUND)

    def take_off(self, height_m: float = 3.0) -> None:
        """Wait until ready, arm, climb and hover."""
        self.run_until(lambda: self.px4.status.ready, 10.0)
        assert self.command(ARM, 1.0) == [0]
        altitude_m = HOME_ALTITUDE_M - self.px4.status.home_m[2] + height_m
        assert self.command(TAKEOFF, *[math.nan] * 6, altitude_m) == [0]
        self.run_until(lambda: self.mode is Mode.HOLD, 30.0)
        self.run(5.0)

    def fly_offboard(self, message: Any, seconds: float) -> None:
        """Take off, enter OFFBOARD with zero setpoints, then follow the message."""
        self.take_off()
        self.run(0.5, setpoint())
        assert self.set_mode(Mode.OFFBOARD) == [0, 0]
        self.run(seconds, message)

    def received(self, name: str, link: str = COMPANION, since_ns: int = 0) -> list[Any]:
        """Messages of one kind that came over a link."""
        return [m for t, on, m in self.sent if (on, m.get_type()) == (link, name) and t > since_ns]

    def types_sent(self, link: str, since_ns: int = 0) -> list[str]:
        return [m.get_type() for t, name, m in self.sent if name == link and t > since_ns]


def hovering(height_m: float = 3.0, **config: Any) -> VehicleInHand:
    """A vehicle in Hold, so high above the ground."""
    vehicle = VehicleInHand(**config)
    vehicle.take_off(height_m)
    return vehicle


def in_offboard(message: Any, seconds: float, **config: Any) -> VehicleInHand:
    """A vehicle in OFFBOARD that has followed a message for so long."""
    vehicle = VehicleInHand(**config)
    vehicle.fly_offboard(message, seconds)
    return vehicle
