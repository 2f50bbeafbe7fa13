"""What a recorder costs perception's process, in processor time alone: no frame is matched.

    python tests/measure_turn_feed.py [--raw]

Turns with a 640 x 480 picture and three states of the gate each are handed on at 50 Hz, with
``dfvs-record`` listening and without. Processor time hardly depends on what else is running.
"""

import argparse
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np
import psutil
from loopback import peer
from recorded_flight import fly

from dfvs_core.messages.image import encode_jpeg
from dfvs_core.messages.topics import Topics
from dfvs_service.perception.record_publisher import RecordPublisher

TURNS, PERIOD_S = 500, 0.02


def spend(feed, turn, payload):
    """Processor time of this process for every turn, ms."""
    start = time.process_time()
    for _ in range(TURNS):
        feed.offer(turn, payload)
        time.sleep(PERIOD_S)
    return 1e3 * (time.process_time() - start) / TURNS


def picture(raw):
    """A 640 x 480 picture as a camera would send it."""
    from textured_wall import Wall, texture

    image = cv2.resize(Wall(texture(np.random.default_rng(1))).picture(), (640, 480))
    return image.tobytes() if raw else encode_jpeg(image)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--raw", action="store_true", help="raw pixels instead of JPEG")
    payload = picture(parser.parse_args().raw)
    flight = fly(np.random.default_rng(1), 4)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    with peer(listen=(endpoint,)) as session, tempfile.TemporaryDirectory() as folder:
        feed = RecordPublisher(session, Topics("bottled"), print)
        feed.offer(*flight.events[0])
        alone_ms = spend(feed, flight.turns[0], payload)
        words = ["--out", str(Path(folder) / "r"), "--vehicle", "bottled"]
        words += ["--set", f'zenoh.listen=["{endpoint}"]']
        recorder = subprocess.Popen([sys.executable, "-m", "dfvs_service.record.cli", *words])
        while not feed.wanted:
            time.sleep(0.05)
        time.sleep(2.0)
        before = psutil.Process(recorder.pid).cpu_times()
        recorded_ms = spend(feed, flight.turns[0], payload)
        after = psutil.Process(recorder.pid).cpu_times()
        recorder.send_signal(signal.SIGINT)
        recorder.wait(30.0)
        feed.close()
    recorder_ms = 1e3 * (after.user + after.system - before.user - before.system) / TURNS
    print(
        f"{len(payload) / 1e3:.0f} kB a frame: perception {alone_ms:.2f} ms a turn without and "
        f"{recorded_ms:.2f} ms with a recorder, which itself needs {recorder_ms:.2f} ms"
    )


if __name__ == "__main__":
    main()
