"""Stands in for perception: flies to a point ahead by the vehicle's own position, at 30 Hz.

The gate cannot tell it from the real one: it speaks the same datagrams. ``--forward`` is the
distance of the goal. Writes the gate's last challenge to ``challenge``, passes on a command found
in ``command``. Ends when the parent's pipe ends.
"""

import argparse
import contextlib
import math
import os
import select
import signal
import socket
import sys
import time
from pathlib import Path

from dfvs_core.messages.link import (
    ForwardedCommand,
    GateStatus,
    PerceptionReport,
    VehicleState,
    from_datagram,
    to_datagram,
)

GAIN = 0.8
BLIND = PerceptionReport(
    seq=0,
    t_capture_ns=0,
    velocity=(0.0, 0.0, 0.0, 0.0),
    healthy=False,
    reached=False,
    lost=False,
    reason="no camera frame on dfvs/drone1/camera",
    error_m=1e6,
    error_rad=1e6,
    overlap=0.0,
)


def report(seq: int, vehicle: VehicleState, goal: tuple[float, float, float]) -> PerceptionReport:
    north, east, down = (g - p for g, p in zip(goal, vehicle.position_m, strict=True))
    c, s = math.cos(vehicle.yaw_rad), math.sin(vehicle.yaw_rad)
    forward, right = c * north + s * east, c * east - s * north
    error = math.hypot(north, east, down)
    gain = GAIN * min(1.0, 1.0 / (GAIN * error + 1e-9))  # at most 1 m/s: the gate limits further
    return PerceptionReport(
        seq=seq,
        t_capture_ns=time.monotonic_ns() - 30_000_000,
        velocity=(gain * forward, gain * right, gain * down, 0.0),
        healthy=True,
        reached=error < 0.1,
        lost=False,
        reason="",
        error_m=error,
        error_rad=0.0,
        overlap=0.9,
        feature_error=error / 3.0,
    )


class FakePerception:
    def __init__(self, runtime: Path, ahead_m: float, *, blind: bool) -> None:
        self.runtime = runtime
        self.ahead_m = ahead_m
        self.blind = blind
        self.goal: tuple[float, float, float] | None = None
        self.seq = 0
        self.inbox = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.inbox.bind(str(runtime / "perception.sock"))
        self.inbox.setblocking(False)

    def newest_status(self) -> GateStatus | None:
        status = None
        with contextlib.suppress(BlockingIOError):
            while True:
                status = from_datagram(GateStatus, self.inbox.recv(65536))
        return status

    def send(self, message: PerceptionReport | ForwardedCommand) -> None:
        with contextlib.suppress(FileNotFoundError, ConnectionRefusedError, BlockingIOError):
            self.inbox.sendto(to_datagram(message), str(self.runtime / "gate.sock"))

    def publish(self, challenge: str) -> None:
        """Replace the file in one step: whoever reads it finds all of a challenge."""
        draft = self.runtime / "challenge.new"
        draft.write_text(challenge)
        draft.rename(self.runtime / "challenge")

    def pass_on(self) -> None:
        """Take the command away before it is sent: one that follows its answer stays."""
        command = self.runtime / "command"
        if command.exists():
            text = command.read_text()
            command.unlink()
            self.send(ForwardedCommand(text))

    def turn(self) -> None:
        status = self.newest_status()
        if status is not None:
            self.publish(status.challenge)
        self.pass_on()
        if self.blind:
            self.send(BLIND)
        elif status is not None and status.vehicle is not None:
            self.seq += 1
            self.goal = self.goal or ahead(status.vehicle, self.ahead_m)
            self.send(report(self.seq, status.vehicle, self.goal))


def ahead(vehicle: VehicleState, distance_m: float) -> tuple[float, float, float]:
    (north, east, down), yaw = vehicle.position_m, vehicle.yaw_rad
    return north + distance_m * math.cos(yaw), east + distance_m * math.sin(yaw), down


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--runtime", type=Path, required=True)
    parser.add_argument("--forward", type=float, default=30.0)
    parser.add_argument("--blind", action="store_true", help="no frame ever arrives")
    args = parser.parse_args()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    perception = FakePerception(args.runtime, args.forward, blind=args.blind)
    while not select.select([sys.stdin], [], [], 0)[0] or os.read(0, 4096):
        perception.turn()
        time.sleep(1 / 30)


if __name__ == "__main__":
    main()
