"""Stands in for perception: flies to a point ahead by the vehicle's own position, at 30 Hz.

The gate cannot tell it from the real one: it speaks the same datagrams. ``--forward`` is the
distance of the goal. Writes the gate's last challenge to ``challenge``, passes on a command found
in ``command``. Ends when the parent's pipe ends.
"""

from __future__ import annotations

import argparse
import math
import os
import select
import signal
import socket
import sys
import time
from pathlib import Path

from dfvs_core.wire.link import (
    ForwardedCommand,
    GateStatus,
    PerceptionReport,
    VehicleState,
    from_datagram,
    to_datagram,
)

GAIN = 0.8


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


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--runtime", type=Path, required=True)
    parser.add_argument("--forward", type=float, default=30.0)
    args = parser.parse_args()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    inbox = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    inbox.bind(str(args.runtime / "perception.sock"))
    inbox.setblocking(False)
    gate = str(args.runtime / "gate.sock")
    seq, goal = 0, None
    while True:
        time.sleep(1 / 30)
        if select.select([sys.stdin], [], [], 0)[0] and not os.read(0, 4096):
            return
        status = None
        try:
            while True:
                status = from_datagram(GateStatus, inbox.recv(65536))
        except BlockingIOError:
            pass
        if status is not None:
            (args.runtime / "challenge").write_text(status.challenge)
        if (args.runtime / "command").exists():
            payload = (args.runtime / "command").read_text()
            (args.runtime / "command").unlink()
            inbox.sendto(to_datagram(ForwardedCommand(payload)), gate)
        if status is None or status.vehicle is None:
            continue
        if goal is None:
            (n, e, d), yaw = status.vehicle.position_m, status.vehicle.yaw_rad
            goal = (n + args.forward * math.cos(yaw), e + args.forward * math.sin(yaw), d)
        seq += 1
        try:
            inbox.sendto(to_datagram(report(seq, status.vehicle, goal)), gate)
        except (FileNotFoundError, ConnectionRefusedError, BlockingIOError):
            continue


if __name__ == "__main__":
    main()
