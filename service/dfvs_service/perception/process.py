"""Perception process: one loop between Zenoh, the pipeline and the gate."""

import dataclasses
import gc
import logging
import time
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from types import FrameType
from typing import Any

import zenoh

from dfvs_common.clock import local_clock
from dfvs_common.progress import warn
from dfvs_core.errors import DfvsError
from dfvs_core.messages.goal import GoalSidecar, Mount, mount_difference
from dfvs_core.messages.goal_command import GoalCommand
from dfvs_core.messages.image import encode_png
from dfvs_core.messages.link import FromGate, GateStatus, PerceptionReport
from dfvs_core.messages.schema import dump
from dfvs_core.messages.topics import Topics
from dfvs_core.perception.frame_result import FrameResult
from dfvs_service import zenoh_session
from dfvs_service.flight_feed import FlightFeed
from dfvs_service.frames import RawSample
from dfvs_service.gate_link import GateLink
from dfvs_service.goal_store import GoalStore
from dfvs_service.mailbox import Mailbox
from dfvs_service.pace import Pace
from dfvs_service.perception.announced import CameraDoubts, subscribe_calibration
from dfvs_service.perception.assembly import (
    Clocks,
    build_frame_processor,
    depth_network,
    flow_matcher,
    servo_task,
)
from dfvs_service.perception.frame_processor import ProcessedFrame, unhealthy_report
from dfvs_service.perception.frame_rate_limiter import FrameRateLimiter
from dfvs_service.perception.frame_source import make_frame_source
from dfvs_service.perception.preallocation import preallocate
from dfvs_service.perception.record_publisher import RecordPublisher
from dfvs_service.perception.recorder import FrameRecorder
from dfvs_service.perception.route_follower import RouteFollower
from dfvs_service.perception.telemetry.images import TelemetryImages
from dfvs_service.perception.telemetry.messages import (
    LatencyWindow,
    servo_document,
    timing_document,
)
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.goal_file import commanded_goal, load_goals
from dfvs_service.settings.runtime import RuntimeFolder
from dfvs_service.telemetry import Telemetry

_TIMING_PERIOD_NS = 1_000_000_000
_COLLECTION_PERIOD_NS = 10_000_000_000
_THUMBNAIL_PERIOD_NS = 1_000_000_000
_RECORDER_PATIENCE_S = 10.0
_LINK_PATIENCE_S = 10.0
_KEPT_STATUSES = 256

log = logging.getLogger("dfvs.perception")


class PerceptionProcess:
    """Takes frames from Zenoh and vehicle states from the gate, and answers with reports.

    ``runtime`` holds the goals to fly to in a row.

    Raises
    ------
    DfvsError
        If a goal or a model cannot be used.
    """

    def __init__(self, config: ServiceConfig, runtime: RuntimeFolder) -> None:
        goals = load_goals(runtime)
        self._config = config
        self._topics = Topics(config.vehicle.name)
        self._runtime = runtime
        self._statuses: deque[GateStatus] = deque(maxlen=_KEPT_STATUSES)
        self._gate = GateLink(runtime.gate_socket, runtime.perception_socket, self._on_gate)
        self._new_goals = GoalStore(runtime.new_goals)
        self._flight_feed = FlightFeed(runtime.black_box_socket)
        self._mailbox: Mailbox[RawSample] = Mailbox()
        self._latency = LatencyWindow()
        self._clock = local_clock()
        self._source = make_frame_source(config, self._clock)
        self._goal = goal = goals[0]
        camera = config.camera.model() or goal.sidecar.camera
        self._flown = GoalSidecar(camera, mount=config.camera.mount or Mount())
        self._doubts = CameraDoubts(camera)
        limiter = FrameRateLimiter(camera.size, config.silence_s, time.monotonic_ns())
        self._rate_limiter = limiter if config.camera.source == "dfvs" else None
        self._matcher = flow_matcher(config.flow)
        self._workers = ThreadPoolExecutor(max_workers=1, thread_name_prefix="next-goal")
        self._route = RouteFollower(config, goals, self._workers)
        self._goal_digest = self._goal_flaw = ""
        clocks = Clocks(self._clock, time.monotonic_ns, time.monotonic_ns)
        self._frame_processor = build_frame_processor(
            config, goal, self._matcher, clocks, depth_network(config)
        )
        self._last_frame_ns = time.monotonic_ns()
        section = config.telemetry
        self._images = TelemetryImages(
            self._clock,
            config.servo.min_confidence,
            section.preview_quality,
            self._flight_feed.max_bytes,
        )
        self._preview_pace = Pace.of_rate(section.preview_hz)
        self._flow_pace = Pace.of_rate(section.flow_hz)
        self._thumbnail_pace = Pace(_THUMBNAIL_PERIOD_NS if config.black_box.enabled else 0)
        self._timing_pace = Pace(_TIMING_PERIOD_NS)
        self._collection_pace = Pace(_COLLECTION_PERIOD_NS)
        self._frames = 0
        self._recorder = FrameRecorder(config, self._clock)
        self._stopped = False

    def run(self) -> None:
        """Work until told to stop."""
        session = self._open()
        if session is None:
            return
        with session:
            telemetry = Telemetry(session, self._topics, self._gate.report, self._flight_feed.put)
            patience_s = _RECORDER_PATIENCE_S if self._config.record.folder else 0.0
            publisher = RecordPublisher(session, self._topics, self._gate.report, patience_s)
            telemetry.offer_json("config", dump(self._config))
            self._publish_goal(telemetry, publisher)
            frames = session.declare_subscriber(self._source.key, self._on_frame)
            camera = subscribe_calibration(session, self._source, self._doubts.on_camera)
            log.info("listening for frames on %s", self._source.key)
            size = self._matcher.encode(self._goal.image).size
            log.info("frames are matched at %d x %d px", *reversed(size))
            preallocate()
            while not self._stopped:
                self._step(telemetry, publisher)
            del frames, camera
            publisher.close()
            telemetry.close()
        self._flight_feed.close()
        self._workers.shutdown(wait=False, cancel_futures=True)
        self._gate.close()

    def stop(self, _signal: int, _frame: FrameType | None) -> None:
        """Signal handler: end after the frame at hand."""
        self._stopped = True

    def _open(self) -> zenoh.Session | None:
        """Connect to the operator link, or wait for the router; None if stopped before."""
        config = self._config.zenoh
        section = zenoh_session.inner_zenoh(config, self._runtime)
        if config.mode == "client":
            return zenoh_session.open_persistently(section, lambda: self._stopped, self._send_fault)
        return zenoh_session.open_within(section, _LINK_PATIENCE_S, lambda: self._stopped)

    def _send_fault(self, text: str) -> None:
        """Tell the gate why there are no frames."""
        log.warning("%s", text)
        self._send(unhealthy_report(0, 0, text))

    def _publish_goal(self, telemetry: Telemetry, publisher: RecordPublisher) -> None:
        """Publish the session header of the frame records from here on, and the goal."""
        header = self._recorder.open(self._goal, self._frame_processor.pipeline.observed_ns)
        publisher.offer(header, encode_png(self._goal.image))
        image, now_ns = self._goal.image, time.monotonic_ns()
        telemetry.offer("goal", lambda: self._images.goal(image, now_ns))
        where = {"t_ns": now_ns, "goal": self._route.index + 1, "of": self._route.count}
        telemetry.offer_json("route", where)
        telemetry.offer_json("build", {"versions": header.build, "model": header.model})

    def _change_goal(self, digest: str, telemetry: Telemetry, publisher: RecordPublisher) -> None:
        """Take the goal that the gate accepted; an unusable one is none, and reported."""
        self._goal_digest, self._goal_flaw = digest, ""
        try:
            command = GoalCommand.from_bytes(self._new_goals.pop(digest))
            self._goal = commanded_goal(command, self._flown)
            self._route = RouteFollower(self._config, [self._goal], self._workers)
        except DfvsError as error:
            self._goal_flaw = f"the new goal cannot be used: {error}"
            warn(self._goal_flaw)
            return
        if difference := mount_difference(self._flown.mount, self._goal.sidecar.mount):
            warn(difference)
        pipeline = self._frame_processor.pipeline
        pipeline.set_goal(servo_task(self._config, self._goal), pipeline.prepare(self._goal))
        self._publish_goal(telemetry, publisher)
        log.info("looking for the goal %s", digest[:12])

    def _on_frame(self, sample: zenoh.Sample) -> None:
        """Zenoh's thread: keep the newest sample, do nothing else."""
        attachment, now_ns = zenoh_session.attachment_of(sample), time.monotonic_ns()
        if self._rate_limiter is None or self._rate_limiter.admits(attachment, now_ns):
            payload, publisher = sample.payload.to_bytes(), zenoh_session.publisher_of(sample)
            self._mailbox.put(RawSample(payload, attachment, now_ns, publisher))

    def _on_gate(self, message: FromGate) -> None:
        """Thread of the gate's datagrams: keep states until the next step."""
        if isinstance(message, GateStatus):
            self._statuses.append(message)

    def _step(self, telemetry: Telemetry, publisher: RecordPublisher) -> None:
        sample = self._next_sample()
        statuses = self._read_gate()
        if statuses and statuses[-1].goal != self._goal_digest:
            self._change_goal(statuses[-1].goal, telemetry, publisher)
        if self._goal_flaw:  # there is nothing to fly to, whatever the camera sees
            sample = self._goal_flaw
        now_ns = time.monotonic_ns()
        if isinstance(sample, str):
            report = unhealthy_report(0, 0, sample)
            self._send(report)
            publisher.offer(self._recorder.without_sample(now_ns, statuses, report))
        else:
            self._last_frame_ns = now_ns
            processed = self._frame_processor.process(sample)
            if processed.is_reported:
                self._send(processed.report, processed.frame_result)
            servo = self._publish_results(telemetry, processed)
            publisher.offer(
                self._recorder.with_sample(sample, statuses, processed, servo), sample.payload
            )
            self._latency.add({"depth": self._frame_processor.pipeline.work_between_frames()})
            self._go_on(processed, telemetry, publisher)
        if self._collection_pace.due(now_ns):
            gc.collect()

    def _send(self, report: PerceptionReport, frame_result: FrameResult | None = None) -> None:
        """Report to the gate, with the goal that it is about."""
        report = self._route.amend(report, frame_result)
        self._gate.send(dataclasses.replace(report, goal=self._goal_digest))

    def _go_on(
        self, processed: ProcessedFrame, telemetry: Telemetry, publisher: RecordPublisher
    ) -> None:
        """Go on to the next goal of the route once it is in sight."""
        if processed.frame is None or processed.frame_result is None:
            return
        t_ns, processor = processed.frame.t_capture_ns, self._frame_processor
        self._route.follow(
            processed.frame_result, t_ns, engaged=processor.servoing, paused=processor.paused
        )
        if self._route.go_on(processor.pipeline, t_ns):
            self._goal = self._route.goal
            log.info("goal %d of %d", self._route.index + 1, self._route.count)
            self._publish_goal(telemetry, publisher)

    def _read_gate(self) -> list[GateStatus]:
        """Receive all statuses of the gate since the last step, and return them."""
        statuses = []
        while self._statuses:
            statuses.append(self._statuses.popleft())
            self._frame_processor.on_gate_status(statuses[-1])
        return statuses

    def _next_sample(self) -> RawSample | str:
        """Newest sample in our own wire format, or why there is none to look at."""
        sample = self._mailbox.get(self._config.silence_s)
        if sample is None:
            since_s = (time.monotonic_ns() - self._last_frame_ns) * 1e-9
            cause = self._config.camera.silence_cause
            return f"no camera frame on {self._source.key} for {since_s:.2f} s{cause}"
        try:
            return self._source.translate(sample)
        except DfvsError as error:
            return f"the frame cannot be read: {error}"

    def _publish_results(self, telemetry: Telemetry, processed: ProcessedFrame) -> dict[str, Any]:
        """Hand one frame's results to the telemetry thread; return its servo document."""
        now_ns = time.monotonic_ns()
        frame, frame_result = processed.frame, processed.frame_result
        if processed.stages_ns is not None:
            self._latency.add(processed.stages_ns)
        if self._timing_pace.due(now_ns):
            counters = {
                "frames": self._frames,
                "refused": self._frame_processor.refused,
                "overtaken": self._mailbox.dropped,
                "turned_away": 0 if self._rate_limiter is None else self._rate_limiter.turned_away,
            }
            telemetry.offer_json(
                "timing", timing_document(self._latency.summary(), now_ns, counters)
            )
        if frame is None or frame_result is None:
            return {}
        self._frames += 1
        servo = servo_document(frame, frame_result, now_ns, processed.stages_ns or {})
        telemetry.offer_json("servo", servo)
        if self._thumbnail_pace.due(now_ns):
            telemetry.offer("thumbnail", lambda: self._images.thumbnail(frame))
        if self._preview_pace.due(now_ns):
            telemetry.offer("preview", lambda: self._images.preview(frame, frame_result.flow))
        if self._flow_pace.due(now_ns):
            telemetry.offer("flow", lambda: self._images.flow(frame, frame_result.flow))
        return servo
