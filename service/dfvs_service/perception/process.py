"""The perception process: one loop between Zenoh, the pipeline and the gate."""

from __future__ import annotations

import dataclasses
import gc
import logging
import time
from collections import deque
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import FrameType
from typing import Any

import zenoh

from dfvs_core.errors import ConfigError, DfvsError
from dfvs_core.messages.frame import BOOT_ID_FILE, clock_identity
from dfvs_core.messages.goal import Goal, GoalSidecar, Mount
from dfvs_core.messages.goal_command import GoalOrder
from dfvs_core.messages.image import encode_png
from dfvs_core.messages.link import FromGate, GateStatus, PerceptionReport
from dfvs_core.messages.schema import dump
from dfvs_core.messages.topics import Topics
from dfvs_service.flight_feed import FlightFeed
from dfvs_service.gate_link import GateLink
from dfvs_service.goal_store import GoalStore
from dfvs_service.pace import Pace
from dfvs_service.perception.announced import CameraDoubts, subscribe_calibration
from dfvs_service.perception.assembly import (
    Clocks,
    build_frame_processor,
    depth_network,
    flow_matcher,
    servo_task,
)
from dfvs_service.perception.frame_processor import (
    FrameProcessor,
    ProcessedFrame,
    RawSample,
    unhealthy_report,
)
from dfvs_service.perception.frame_rate_limiter import FrameRateLimiter
from dfvs_service.perception.frame_source import make_frame_source
from dfvs_service.perception.images import TelemetryImages
from dfvs_service.perception.latency import LatencyWindow
from dfvs_service.perception.mailbox import Mailbox
from dfvs_service.perception.messages import servo_document, timing_document
from dfvs_service.perception.preallocation import preallocate
from dfvs_service.perception.record_publisher import RecordPublisher
from dfvs_service.perception.recorder import FrameRecorder
from dfvs_service.perception.route_follower import RouteFollower
from dfvs_service.perception.session_header import make_session_header
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.goal_file import commanded_goal
from dfvs_service.settings.runtime import RuntimeFolder
from dfvs_service.telemetry import Telemetry
from dfvs_service.zenoh_session import inner_zenoh, open_session

_TIMING_PERIOD_NS = 1_000_000_000
_COLLECTION_PERIOD_NS = 10_000_000_000
_THUMBNAIL_PERIOD_NS = 1_000_000_000
_RECORDER_PATIENCE_S = 10.0
_LINK_PATIENCE_S, _LINK_PAUSE_S = 10.0, 0.1
_KEPT_STATUSES = 256

log = logging.getLogger("dfvs.perception")


class PerceptionProcess:
    """Takes frames from Zenoh and vehicle states from the gate, and answers with reports.

    Parameters
    ----------
    config : ServiceConfig
        Resolved settings, the camera's intrinsics among them.
    goals : sequence of Goal
        Where to fly to: one goal, or several in a row.
    runtime : RuntimeFolder
        Where the service's processes meet.
    """

    def __init__(
        self, config: ServiceConfig, goals: Sequence[Goal], runtime: RuntimeFolder
    ) -> None:
        self._config = config
        self._topics = Topics(config.vehicle.name)
        self._runtime = runtime
        self._heard: deque[GateStatus] = deque(maxlen=_KEPT_STATUSES)
        self._gate = GateLink(runtime.gate_socket, runtime.perception_socket, self._on_gate)
        self._new_goals = GoalStore(runtime.new_goals)
        self._flight_feed = FlightFeed(runtime.black_box_socket)
        self._mailbox: Mailbox[RawSample] = Mailbox()
        self._latency = LatencyWindow()
        self._clock = clock_identity(Path(BOOT_ID_FILE).read_text(encoding="ascii"))
        self._intake = make_frame_source(config, self._clock)
        self._goal = goal = goals[0]
        camera = config.camera.model() or goal.sidecar.camera
        self._doubts = CameraDoubts(camera)
        is_ours = config.camera.source == "dfvs"
        self._door = FrameRateLimiter(camera.size, time.monotonic_ns()) if is_ours else None
        self._matcher = flow_matcher(config.flow)
        self._depth = depth_network(config)
        self._workers = ThreadPoolExecutor(max_workers=1, thread_name_prefix="look-ahead")
        self._route = RouteFollower(config, goals, self._workers)
        self._goal_digest = self._goal_flaw = ""
        self._eye = self._build_eye(goal)
        self._last_frame_ns = time.monotonic_ns()
        told = config.telemetry
        self._pictures = TelemetryImages(
            self._clock, config.servo.min_confidence, told.preview_quality
        )
        self._preview_pace = Pace.of_rate(told.preview_hz)
        self._flow_pace = Pace.of_rate(told.flow_hz)
        self._thumbnail_pace = Pace(_THUMBNAIL_PERIOD_NS if config.black_box.enabled else 0)
        self._timing_pace = Pace(_TIMING_PERIOD_NS)
        self._collection_pace = Pace(_COLLECTION_PERIOD_NS)
        self._frames = 0
        self._book = FrameRecorder()
        self._stopped = False

    def run(self) -> None:
        """Work until told to stop."""
        session = self._open_session()
        if session is None:
            return
        with session:
            telemetry = Telemetry(session, self._topics, self._gate.report, self._flight_feed.put)
            patience_s = _RECORDER_PATIENCE_S if self._config.record.folder else 0.0
            feed = RecordPublisher(session, self._topics, self._gate.report, patience_s)
            telemetry.offer_json("config", dump(self._config))
            self._tell_goal(telemetry, feed)
            frames = session.declare_subscriber(self._intake.key, self._on_frame)
            camera = subscribe_calibration(session, self._intake, self._doubts.take)
            log.info("listening for frames on %s", self._intake.key)
            size = self._matcher.prepare(self._goal.image).size
            log.info("frames are matched at %d x %d px", *reversed(size))
            preallocate()
            while not self._stopped:
                self._turn(telemetry, feed)
            del frames, camera
            feed.close()
            telemetry.close()
        self._flight_feed.close()
        self._workers.shutdown(wait=False, cancel_futures=True)
        self._gate.close()

    def stop(self, _signal: int, _frame: FrameType | None) -> None:
        """Signal handler: end after the frame at hand."""
        self._stopped = True

    def _open_session(self) -> zenoh.Session | None:
        """Wait for the operator link or the router; None if told to stop before.

        Raises
        ------
        ConfigError
            If it does not answer in time.
        """
        section = inner_zenoh(self._config.zenoh, self._runtime)
        deadline = time.monotonic() + _LINK_PATIENCE_S
        while not self._stopped:
            try:
                return open_session(section)
            except ConfigError:
                if time.monotonic() > deadline:
                    raise
            time.sleep(_LINK_PAUSE_S)
        return None

    def _build_eye(self, goal: Goal) -> FrameProcessor:
        clocks = Clocks(self._clock, time.monotonic_ns, time.monotonic_ns)
        return build_frame_processor(self._config, goal, self._matcher, clocks, self._depth)

    def _tell_goal(self, telemetry: Telemetry, feed: RecordPublisher) -> None:
        """Tell recorders with what the turns from here on work, and everybody the goal."""
        opening = make_session_header(
            self._config, self._goal, self._clock, self._book.next_record, self._eye.observed_ns
        )
        self._book.open(opening)
        feed.offer(opening, encode_png(self._goal.image))
        image, now_ns = self._goal.image, time.monotonic_ns()
        telemetry.offer("goal", lambda: self._pictures.goal(image, now_ns))
        where = {"t_ns": now_ns, "goal": self._route.index + 1, "of": self._route.count}
        telemetry.offer_json("route", where)
        telemetry.offer_json("build", {"versions": opening.build, "model": opening.model})

    def _change_goal(self, digest: str, telemetry: Telemetry, feed: RecordPublisher) -> None:
        """Look for the goal that the gate accepted; one that is unusable is none, and said so."""
        self._goal_digest, self._goal_flaw = digest, ""
        settings = self._config.camera
        camera = settings.model() or self._goal.sidecar.camera
        flown = GoalSidecar(camera, mount=settings.mount or Mount())
        try:
            order = GoalOrder.from_bytes(self._new_goals.take(digest))
            self._goal = commanded_goal(order, flown)
            self._route = RouteFollower(self._config, [self._goal], self._workers)
        except DfvsError as error:
            self._goal_flaw = f"the new goal cannot be used: {error}"
            log.warning("%s", self._goal_flaw)
            return
        self._eye.set_goal(servo_task(self._config, self._goal), self._eye.prepare(self._goal))
        self._tell_goal(telemetry, feed)
        log.info("looking for the goal %s", digest[:12])

    def _on_frame(self, sample: zenoh.Sample) -> None:
        """Zenoh's thread: keep the newest sample, do nothing else."""
        attachment = b"" if sample.attachment is None else sample.attachment.to_bytes()
        now_ns = time.monotonic_ns()
        if self._door is None or self._door.admits(attachment, now_ns):
            self._mailbox.put(RawSample(sample.payload.to_bytes(), attachment, now_ns))

    def _on_gate(self, message: FromGate) -> None:
        """Thread of the gate's datagrams: keep states until the next turn."""
        if isinstance(message, GateStatus):
            self._heard.append(message)

    def _turn(self, telemetry: Telemetry, feed: RecordPublisher) -> None:
        sample = self._next_sample()
        heard = self._read_gate()
        if heard and heard[-1].goal != self._goal_digest:
            self._change_goal(heard[-1].goal, telemetry, feed)
        if self._goal_flaw:  # there is nothing to fly to, whatever the camera sees
            sample = self._goal_flaw
        now_ns = time.monotonic_ns()
        if isinstance(sample, str):
            report = unhealthy_report(0, 0, sample)
            self._send(report)
            feed.offer(self._book.silent(now_ns, heard, report))
        else:
            self._last_frame_ns = now_ns
            glance = self._eye.look(sample)
            self._send(glance.report)
            servo = self._tell(telemetry, glance)
            feed.offer(self._book.looked(sample, heard, glance, servo), sample.payload)
            self._latency.add({"depth": self._eye.update_depth()})
            self._go_on(glance, telemetry, feed)
        if self._collection_pace.due(now_ns):
            gc.collect()

    def _send(self, report: PerceptionReport) -> None:
        """Tell the gate, and about which goal it is."""
        report = self._route.amend(report)
        self._gate.send(dataclasses.replace(report, goal=self._goal_digest))

    def _go_on(self, glance: ProcessedFrame, telemetry: Telemetry, feed: RecordPublisher) -> None:
        """Go on to the next goal of the route once it is in sight."""
        if glance.frame is None or glance.outcome is None:
            return
        t_ns = glance.frame.t_capture_ns
        self._route.follow(self._eye, glance.outcome, t_ns)
        if self._route.go_on(self._eye, t_ns):
            self._goal = self._route.goal
            log.info("goal %d of %d", self._route.index + 1, self._route.count)
            self._tell_goal(telemetry, feed)

    def _read_gate(self) -> list[GateStatus]:
        """Take in everything the gate said since the last turn, and return it."""
        heard = []
        while self._heard:
            heard.append(self._heard.popleft())
            self._eye.heed(heard[-1])
        return heard

    def _next_sample(self) -> RawSample | str:
        """Newest sample in our own wire format, or why there is none to look at."""
        sample = self._mailbox.take(self._config.silence_s)
        if sample is None:
            since_s = (time.monotonic_ns() - self._last_frame_ns) * 1e-9
            return f"no camera frame on {self._intake.key} for {since_s:.2f} s"
        try:
            return self._intake.translate(sample)
        except DfvsError as error:
            return f"the frame cannot be read: {error}"

    def _tell(self, telemetry: Telemetry, glance: ProcessedFrame) -> dict[str, Any]:
        """Hand one frame's results to the telemetry thread; return its servo document."""
        now_ns = time.monotonic_ns()
        frame, outcome = glance.frame, glance.outcome
        if glance.stages_ns is not None:
            self._latency.add(glance.stages_ns)
        if self._timing_pace.due(now_ns):
            counters = {
                "frames": self._frames,
                "refused": self._eye.refused,
                "overtaken": self._mailbox.dropped,
                "turned_away": 0 if self._door is None else self._door.turned_away,
            }
            telemetry.offer_json(
                "timing", timing_document(self._latency.summary(), now_ns, counters)
            )
        if frame is None or outcome is None:
            return {}
        self._frames += 1
        servo = servo_document(frame, outcome, now_ns, glance.stages_ns or {})
        telemetry.offer_json("servo", servo)
        if self._thumbnail_pace.due(now_ns):
            telemetry.offer("thumbnail", lambda: self._pictures.thumbnail(frame))
        if self._preview_pace.due(now_ns):
            telemetry.offer("preview", lambda: self._pictures.preview(frame, outcome.flow))
        if self._flow_pace.due(now_ns):
            telemetry.offer("flow", lambda: self._pictures.flow(frame, outcome.flow))
        return servo
