"""A vehicle on the wire without a flight: real telemetry of an approach, published over real Zenoh.

``python tests/telemetry_vehicle.py tcp/127.0.0.1:7447`` runs one for the eyes.
"""

import argparse
import functools
import json
import math
import secrets
import threading
import time
from pathlib import Path

import numpy as np
from textured_wall import Wall, exact_flow, texture, turned

from dfvs_core.gate.commands.authority import Authority
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.messages.frame import BOOT_ID_FILE, Frame, PixelFormat, clock_identity, encode_frame
from dfvs_core.messages.goal_command import GoalCommand, goal_digest
from dfvs_core.messages.link import GateStatus, VehicleState
from dfvs_core.messages.schema import dump
from dfvs_core.messages.topics import Topics
from dfvs_core.perception.frame_result import FrameResult
from dfvs_core.perception.goal_tracker import TrackingState
from dfvs_core.servo.exchange import ServoResult, Status, Uncertainty
from dfvs_service.perception.telemetry.images import TelemetryImages
from dfvs_service.perception.telemetry.messages import servo_document, timing_document
from dfvs_service.settings.config import load_config
from dfvs_service.settings.key_file import load_key
from dfvs_service.telemetry import Telemetry
from dfvs_service.zenoh_session import open_session

RATE_HZ = 25.0
PICTURES = 12
LAP_S = 12.0
CLOCK = clock_identity(Path(BOOT_ID_FILE).read_text(encoding="ascii"))


@functools.cache
def approach():
    """Goal picture, views on the way to it, and the flow from each of them to the goal."""
    wall = Wall(texture(np.random.default_rng(4)))
    ways = [turned(3 * s, 1 - 0.15 * s, (70 * s, 25 * s)) for s in np.linspace(1, 0, PICTURES)]
    flows = [exact_flow(np.linalg.inv(H)).astype(np.float32) for H in ways]
    ramp = np.linspace(0.2, 1.0, flows[0].shape[1], dtype=np.float32)
    confidence = np.broadcast_to(ramp, flows[0].shape[:2]).copy()
    return (
        wall.picture(),
        [wall.picture(H) for H in ways],
        [FlowField(f, confidence) for f in flows],
    )


def approach_result(frame, left, flow, mounting_score=12.3, knows_uncertainty=True):
    """Perception's result with the share ``left`` of the way before the vehicle."""
    wobble = 0.02 * math.sin(frame.seq)
    error_m = 0.86 * left + 0.01 + 0.2 * abs(wobble)
    scale = 0.07 + 0.3 * left**2
    uncertainty = Uncertainty(
        error_m=0.004 + scale * error_m,
        scale=scale,
        velocity_error=np.array([0.03, -0.02, 0.01 + wobble, 0.0]),
        velocity_error_m_s=0.03,
        mean_error_m=0.9 * left + 0.01,
        spread_m=0.01 + 0.1 * left,
    )
    result = ServoResult(
        status=Status.OK,
        velocity=np.array([0.3 * left, 0.1 * left, 0.0, 0.1 * left]),
        motion=np.array([0.8 * left, 0.3 * left, -0.1 * left, 0.3 * left]),
        error_m=error_m,
        error_rad=0.3 * left + 0.1 * abs(wobble),
        median_error_px=60.0 * left,
        feature_error=0.4 * left,
        mounting_score=mounting_score,
        residual_px=0.4 + 4 * abs(wobble),
        inlier_share=0.93 - abs(wobble) - 0.2 * left,
        overlap=0.9 - 0.4 * left,
        condition=420.0 + 900 * left + 300 * wobble,
        depth_m=2.6 - 0.5 * left + wobble,
        reached=False,
        uncertainty=uncertainty if knows_uncertainty else None,
    )
    return FrameResult(frame, result, flow, {}, frame.t_capture_ns, TrackingState.TRACKING)


def approach_status(t_ns, t_s, left, **fields):
    """State of the gate after ``t_s`` seconds; ``fields`` replace what is usual."""
    angle = 2 * math.pi * t_s / LAP_S
    position = (1.0 - left, 0.4 * math.sin(angle), -1.3 + 0.1 * math.cos(2 * angle))
    vehicle = VehicleState(t_ns, 0.06, -0.04, 0.4 - 0.3 * left, (0.25 * left, 0.1, 0.02), position)
    usual = {
        "state": "SERVO",
        "cause": "good data",
        "vehicle": vehicle,
        "t_ns": t_ns,
        "mode": "OFFBOARD",
        "armed": True,
        "in_air": True,
        "battery": 0.87,
        "heartbeat_age_s": 0.4,
        "battery_age_s": 0.6,
        "setpoint": (0.3 * left, 0.1 * math.sin(angle), 0.05 * math.cos(angle), 0.1 * left),
        "distance_m": math.dist(position, (0.0, 0.0, -1.3)),
    }
    return GateStatus(**usual | fields)


class TelemetryVehicle:
    """Approaches a textured wall again and again; judges orders as the gate does."""

    def __init__(self, endpoint, name="swift", key=None):
        config = load_config(None, {"vehicle.name": name, "zenoh.listen": [endpoint]})
        self.topics = Topics(name)
        self.state, self.cause = "SERVO", "good data"
        self.since_ns = self.started_ns = time.monotonic_ns()
        self.pictures = TelemetryImages(CLOCK, 0.3, 70, 1_000_000)
        self.goal, self.views, self.flows = approach()
        self.is_paused = False
        self.mounting_score = 12.3
        self.knows_uncertainty = True
        self.halfway = threading.Event()
        """Set by every frame that the goal is neither near nor far in."""
        self.seq = 0
        self.orders = []
        now_ns = time.monotonic_ns()
        self.authority = Authority(key, name, lambda: secrets.token_hex(8), now_ns)
        self.session = open_session(config.zenoh)
        self.telemetry = Telemetry(self.session, self.topics, print, lambda *_: True)
        self.telemetry.offer_json("config", dump(config))
        self.telemetry.offer("goal", lambda: self.pictures.goal(self.goal, now_ns))
        self.goals = []
        declare = self.session.declare_subscriber
        self.commands = declare(self.topics.command, self.on_command)
        self.new_goals = declare(self.topics.new_goal, self.on_goal)
        self.stopped = threading.Event()
        self.thread = threading.Thread(target=self.run)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.stopped.set()
        self.thread.join()
        self.telemetry.close()
        self.session.close()

    def on_command(self, sample):
        verdict = self.authority.evaluate(sample.payload.to_bytes(), time.monotonic_ns())
        self.answer(verdict)
        change = {"hold": ("HOLD", "operator commanded to hold"), "engage": ("SERVO", "good data")}
        change["abort"] = ("ABORT", "operator commanded to abort")
        if verdict.action is not None and str(verdict.action) in change:
            self.enter(*change[str(verdict.action)])

    def on_goal(self, sample):
        data = sample.payload.to_bytes()
        verdict = self.authority.evaluate(sample.attachment.to_bytes(), time.monotonic_ns())
        if verdict.argument == goal_digest(data):
            self.goals.append(GoalCommand.from_bytes(data))
        self.answer(verdict)

    def answer(self, verdict):
        """Answer as the operator link does; the same command counts once."""
        if not verdict.is_repeated:
            self.orders.append(verdict.text)
        document = {"request": verdict.request, "result": verdict.text}
        self.session.put(self.topics.telemetry("answer"), json.dumps(document))

    def pause_halfway(self):
        """Send no more frames, after one that has a flow to be seen."""
        self.halfway.clear()
        assert self.halfway.wait(2 * LAP_S)
        self.is_paused = True

    def enter(self, state, cause):
        self.state, self.cause, self.since_ns = state, cause, time.monotonic_ns()

    def run(self):
        while not self.stopped.wait(1.0 / RATE_HZ):
            if not self.is_paused:
                self.shoot()

    def shoot(self):
        """Publish one frame and everything that follows from it."""
        t_ns = time.monotonic_ns()
        t_s = (t_ns - self.started_ns) * 1e-9
        left = 0.5 + 0.5 * math.cos(2 * math.pi * t_s / LAP_S)
        if 0.4 < left < 0.6:
            self.halfway.set()
        index = round((1.0 - left) * (PICTURES - 1))
        frame = Frame(self.views[index], t_ns, self.seq)
        payload, attachment = encode_frame(frame, PixelFormat.JPEG, CLOCK)
        self.session.put(self.topics.camera, payload, attachment=attachment)
        self.seq += 1
        flow = self.flows[index]
        stages = {"transport": 2_000_000, "match": 25_000_000}
        result = approach_result(frame, left, flow, self.mounting_score, self.knows_uncertainty)
        document = servo_document(frame, result, t_ns + 40_000_000, stages)
        self.telemetry.offer_json("servo", document)
        self.telemetry.offer("flow", lambda: self.pictures.flow(frame, flow))
        if self.seq % 2 == 0:
            self.telemetry.offer_json("state", dump(self.status(t_ns, t_s, left)))
        if self.seq % 25 == 0:
            summary = {"match": {"p50_ms": 25.1, "p99_ms": 41.7, "max_ms": 50.0}}
            counters = {"frames": self.seq, "refused": 0, "overtaken": 3}
            self.telemetry.offer_json("timing", timing_document(summary, t_ns, counters))

    def status(self, t_ns, t_s, left):
        return approach_status(
            t_ns,
            t_s,
            left,
            state=self.state,
            cause=self.cause,
            since_ns=self.since_ns,
            challenge=self.authority.challenge(t_ns),
            command_result=self.orders[-1] if self.orders else "",
            command_count=len(self.orders),
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("endpoint")
    parser.add_argument("--name", default="swift")
    parser.add_argument("--key-file", type=Path)
    parser.add_argument("--seconds", type=float, default=60.0)
    arguments = parser.parse_args()
    key = None if arguments.key_file is None else load_key(arguments.key_file)
    with TelemetryVehicle(arguments.endpoint, arguments.name, key):
        time.sleep(arguments.seconds)


if __name__ == "__main__":
    main()
