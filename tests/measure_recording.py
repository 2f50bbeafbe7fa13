"""What recording costs: perception's frame rate with a recorder and without, in one run.

    python tests/measure_recording.py [--rate HZ] [--raw] [--seconds S] [--rounds N]

A camera publishes 640 x 480 pictures at a rate; perception (the real process) looks at them, and
``dfvs-record`` comes and goes. Prints frames a second and processor time a frame with and without,
and the ratios. Where other work shares the machine the processor time is what to believe.
"""

import argparse
import os
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import cv2
import numpy as np
import psutil
import zenoh
from loopback import free_endpoint, peer
from textured_wall import Wall, texture, turned

from dfvs_common.lifecycle import ONE_BLAS_THREAD
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import BOOT_ID_FILE, Frame, PixelFormat, clock_identity, encode_frame
from dfvs_core.messages.goal import GoalSidecar
from dfvs_core.messages.image import encode_png
from dfvs_core.messages.link import GateStatus, VehicleState, to_datagram
from dfvs_core.messages.topics import Topics
from dfvs_service.settings.config import load_config

CAMERA = CameraModel.from_horizontal_fov(640, 480, 1.3)
TOPICS = Topics("measured")
CLOCK = clock_identity(Path(BOOT_ID_FILE).read_text())
SETTLE_S = 2.0


def pictures(rng, count=24):
    """A wall that comes nearer to how the goal shows it."""
    wall = Wall(texture(rng))
    for i in range(count):
        picture = wall.picture(turned(shift=(12.0 - i, 0.3 * i), zoom=1.0 + 0.002 * i))
        yield cv2.resize(picture, (640, 480), interpolation=cv2.INTER_CUBIC)


class World:
    """Camera and gate around a perception process, each on a thread of its own."""

    def __init__(self, folder, rate_hz, pixel_format):
        self.folder, self.period_s, self.format = folder, 1.0 / rate_hz, pixel_format
        self.images = list(pictures(np.random.default_rng(1)))
        self.endpoint = free_endpoint()
        sidecar = GoalSidecar(CAMERA)
        (folder / "goal.png").write_bytes(encode_png(self.images[-1]))
        (folder / "goal.json").write_text(sidecar.to_json())
        overrides = {"vehicle.name": TOPICS.vehicle, "zenoh.listen": [self.endpoint]}
        config, _ = load_config(None, overrides).with_camera((640, 480), sidecar)
        (folder / "config.json").write_text(config.to_json())
        self.gate = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.gate.bind(str(folder / "gate.sock"))
        self.looked = 0
        command = [sys.executable, "-m", "dfvs_service.perception", "--runtime", str(folder)]
        self.perception = subprocess.Popen(command, env=os.environ | ONE_BLAS_THREAD)
        self.gate.recv(65536)  # it is up
        self.session = peer(listen=(self.endpoint, f"unixsock-stream/{self.folder / 'zenoh.sock'}"))
        for work in (self._listen, self._tell, self._shoot):
            threading.Thread(target=work, daemon=True).start()

    def _listen(self):
        while True:
            # Frames that came too late were not looked at, and no part of the view shows the goal.
            self.looked += b'"overlap":0.0' not in self.gate.recv(65536)

    def _tell(self):
        address = str(self.folder / "perception.sock")
        sender = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        while True:
            vehicle = VehicleState(time.monotonic_ns(), 0.0, 0.0, 0.0, (0.0,) * 3, (0.0,) * 3)
            sender.sendto(to_datagram(GateStatus("READY", "", vehicle)), address)
            time.sleep(0.02)

    def _shoot(self):
        """Pictures are encoded beforehand, but for their number and time."""
        rng, seq, next_s = np.random.default_rng(2), 0, time.monotonic()
        while True:
            seq += 1
            image = self.images[abs((seq // 4) % 46 - 23)].copy()
            image[:8, :8] = rng.integers(0, 255, 3)  # a camera that repeats itself is refused
            frame = Frame(image, time.monotonic_ns(), seq)
            payload, attachment = encode_frame(frame, self.format, CLOCK)
            drop = zenoh.CongestionControl.DROP
            key = TOPICS.camera
            self.session.put(key, payload, attachment=attachment, congestion_control=drop)
            next_s = max(next_s + self.period_s, time.monotonic() - self.period_s)
            time.sleep(max(next_s - time.monotonic(), 0.0))

    def start_recorder(self):
        words = ["--vehicle", TOPICS.vehicle, "--set", f'zenoh.listen=["{self.endpoint}"]']
        out = ["--out", str(self.folder / "recordings")]
        command = [sys.executable, "-m", "dfvs_service.record.cli", *out, *words]
        return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)

    def rate(self, seconds):
        """Frames a second that were looked at, and processor time of each, ms."""
        looked, start, busy_s = self.looked, time.monotonic(), busy(self.perception)
        time.sleep(seconds)
        frames = self.looked - looked
        elapsed_s, spent_s = time.monotonic() - start, busy(self.perception) - busy_s
        return frames / elapsed_s, 1e3 * spent_s / max(frames, 1)

    def close(self):
        self.perception.terminate()
        self.perception.wait(5.0)


def busy(process):
    """Processor time that a process has used, s."""
    times = psutil.Process(process.pid).cpu_times()
    return times.user + times.system


def measure(world, arguments):
    without, recording, recorder_ms = [], [], []
    for _ in range(arguments.rounds):
        time.sleep(SETTLE_S)
        without.append(world.rate(arguments.seconds))
        recorder = world.start_recorder()
        time.sleep(SETTLE_S)
        busy_s = busy(recorder)
        recording.append(world.rate(arguments.seconds))
        frames = max(recording[-1][0] * arguments.seconds, 1.0)
        recorder_ms.append(1e3 * (busy(recorder) - busy_s) / frames)
        recorder.send_signal(signal.SIGINT)
        said, _ = recorder.communicate(timeout=60.0)
        (a_hz, a_ms), (b_hz, b_ms) = without[-1], recording[-1]
        print(
            f"frames/s {a_hz:.2f} without, {b_hz:.2f} with; perception {a_ms:.1f} ms without, "
            f"{b_ms:.1f} ms with, recorder {recorder_ms[-1]:.1f} ms a frame; {said.strip()}",
            flush=True,
        )
    rates = statistics.median(b[0] / a[0] for a, b in zip(without, recording, strict=True))
    times = statistics.median(b[1] / a[1] for a, b in zip(without, recording, strict=True))
    print(
        f"medians: frame rate x {rates:.3f}, perception's processor time x {times:.3f}, "
        f"recorder {statistics.median(recorder_ms):.1f} ms a frame"
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rate", type=float, default=20.0, help="pictures a second")
    parser.add_argument("--raw", action="store_true", help="raw pixels instead of JPEG")
    parser.add_argument("--seconds", type=float, default=8.0, help="of each measurement")
    parser.add_argument("--rounds", type=int, default=4)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        chosen = PixelFormat.RGB8 if arguments.raw else PixelFormat.JPEG
        world = World(Path(folder), arguments.rate, chosen)
        try:
            measure(world, arguments)
        finally:
            world.close()


if __name__ == "__main__":
    main()
