"""Replay of a whole recording, with the reasons why results may differ.

Nothing in perception depends on when it runs but the two times by which a frame's age is judged.
They are part of every frame record, so the same code, model and settings give the same reports.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dfvs_core.messages.frame_record import FrameRecord, SessionHeader
from dfvs_core.messages.goal import Goal
from dfvs_core.messages.schema import dump, with_present_names
from dfvs_core.perception.pipeline import Pipeline
from dfvs_service.flights.records import StateChange
from dfvs_service.frames import RawSample
from dfvs_service.perception.assembly import (
    Clocks,
    build_frame_processor,
    depth_network,
    flow_matcher,
    perception_files,
    servo_task,
)
from dfvs_service.perception.build import build_versions
from dfvs_service.perception.frame_processor import FrameProcessor, ProcessedFrame
from dfvs_service.replay.recording import StateLog, read_recording
from dfvs_service.replay.rerun import (
    RecordedClock,
    Rerun,
    TimedMatcher,
    recorded_goal,
    recorded_settings,
)
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.sections import FlowSection

_SHOWN_CHARACTERS = 24


@dataclass(frozen=True, slots=True)
class Trial:
    """What to try in place of what was flown.

    ``settings`` give ``servo``, ``flow`` and ``depth``; ``model`` is a name or a folder, empty: as
    the settings say.
    """

    settings: ServiceConfig | None = None
    model: str = ""

    def applied_to(self, config: ServiceConfig) -> ServiceConfig:
        """Settings of a flight, of which camera and goal stay, with what is to be tried."""
        if self.settings is not None:
            flow = self.settings.flow
            if flow.working_width_px == 0:  # measured at the start of a flight, and at no replay
                flow = replace(flow, working_width_px=config.flow.working_width_px)
            tried = self.settings
            config = replace(config, servo=tried.servo, flow=flow, depth=tried.depth)
        if self.model:
            config = replace(config, flow=replace(config.flow, model=self.model))
        return config


@dataclass(frozen=True, slots=True)
class Replay:
    """Frames run again, and why they may differ; without a reason every bit must be the same.

    ``times_s`` holds the time of each frame; it and the times of ``states`` are in s from the start
    of the recording. ``warnings`` name files that were left out.
    """

    frames: tuple[Rerun, ...]
    reasons: tuple[str, ...]
    times_s: tuple[float, ...] = ()
    states: tuple[StateChange, ...] = ()
    warnings: tuple[str, ...] = ()


class FlightReplay:
    """Reruns the frame records of a recording one by one."""

    def __init__(self, trial: Trial) -> None:
        self._trial = trial
        self._run: tuple[str, int] | None = None
        self._processor: FrameProcessor | None = None
        self._look, self._servo = RecordedClock(), RecordedClock()
        self._matcher: tuple[FlowSection, TimedMatcher] | None = None
        self._build = build_versions()
        self._next_record = 0
        self.reasons: dict[str, None] = {}
        self.processed: ProcessedFrame | None = None
        """What became of the newest sample of the run, None before the first one."""

    def open(self, header: SessionHeader, image: bytes) -> None:
        """Build perception for the frame records to come; in the same run, go on to its goal.

        Raises
        ------
        DfvsError
            If settings, model or goal (a PNG) cannot be used.
        """
        config = self._trial.applied_to(recorded_settings(header))
        model = perception_files(config)
        for reason in reasons_to_differ(header, config, model, self._build):
            self.reasons[reason] = None
        if self._processor is not None and header.run == self._run:
            _set_goal(self._processor.pipeline, header, recorded_goal(header, image), config)
            return
        self._run, self._next_record, self.processed = header.run, 0, None
        if self._matcher is None or self._matcher[0] != config.flow:
            self._matcher = (config.flow, TimedMatcher(flow_matcher(config.flow)))
        depth, goal = depth_network(config), recorded_goal(header, image)
        clocks = Clocks(bytes.fromhex(header.clock), self._look, self._servo)
        self._processor = build_frame_processor(config, goal, self._matcher[1], clocks, depth)

    def record(self, record: FrameRecord, payload: bytes) -> Rerun | None:
        """Run one frame record again, by the times of then; None for one that saw nothing."""
        if self._processor is None or self._matcher is None:
            return None
        if record.number != self._next_record:
            missing = record.number - self._next_record
            self.reasons[
                f"{missing} frame records before frame record {record.number} were not recorded"
            ] = None
        self._next_record = record.number + 1
        for status in record.heard:
            self._processor.on_gate_status(status)
        sight, timed = record.sight, self._matcher[1]
        if sight is None:
            return None
        self._look.now_ns = sight.t_look_ns
        self._servo.now_ns = sight.t_look_ns if sight.t_servo_ns is None else sight.t_servo_ns
        sample = RawSample(payload, bytes.fromhex(sight.attachment), sight.t_arrival_ns)
        timed.spent_ns, start_ns = 0, time.monotonic_ns()
        self.processed = self._processor.process(sample)
        frame_ns, match_ns = time.monotonic_ns() - start_ns, timed.spent_ns
        self._processor.pipeline.work_between_frames()
        return Rerun(record, self.processed.report, match_ns, frame_ns)


def _set_goal(pipeline: Pipeline, header: SessionHeader, goal: Goal, config: ServiceConfig) -> None:
    """Go on to the goal of a session header that follows in the same flight."""
    task, view = servo_task(config, goal), pipeline.prepare(goal)
    preview = None
    if header.observed_ns is not None:
        preview = pipeline.evaluate_next_goal(task, view, header.observed_ns)
    pipeline.set_goal(task, view, None if preview is None else preview().observation)


def reasons_to_differ(
    header: SessionHeader, config: ServiceConfig, model: Mapping[str, str], build: Mapping[str, str]
) -> tuple[str, ...]:
    """In which ways this replay is not the flight; empty: every bit must be the same.

    ``header`` is of the flight; settings, files of the networks with their SHA-256, and versions
    are of the replay.
    """
    reasons = [
        f"{name} is {_short(build.get(name))}, was {_short(header.build.get(name))}"
        for name in sorted({*build, *header.build})
        if build.get(name) != header.build.get(name)
    ]
    for name, is_depth in (("model", False), ("depth network", True)):
        if _files(model, is_depth) != _files(header.model, is_depth):
            reasons.append(f"the {name}'s files are others")
    now, then = (
        _relevant(dump(config)),
        _relevant(with_present_names(ServiceConfig, header.settings)),
    )
    reasons += [f"the settings of [{name}] are others" for name in now if now[name] != then[name]]
    return tuple(reasons)


def _files(model: Mapping[str, str], is_depth: bool) -> dict[str, str]:
    """Files of the depth network, or of the matcher."""
    return {k: v for k, v in model.items() if k.startswith("depth/") == is_depth}


def _short(version: str | None) -> str:
    return "none" if version is None else version[:_SHOWN_CHARACTERS]


def _relevant(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Sections that perception works by; of a model only how it is used, not where it lies."""
    flow = dict(settings["flow"])
    flow["model"] = flow["model"].partition(":")[0] if ":" in flow["model"] else ""
    return {"camera": settings["camera"], "servo": settings["servo"], "flow": flow}


def replay(paths: Sequence[Path], trial: Trial, show: Callable[[int], None]) -> Replay:
    """Run a recording again; ``show`` receives how many frames were, after each.

    Raises
    ------
    DfvsError
        If recording, settings or model cannot be used.
    """
    flight = FlightReplay(trial)
    frames: list[Rerun] = []
    times_s: list[float] = []
    warnings: list[str] = []
    states = StateLog()
    for entry in read_recording(paths, warnings.append):
        payload = b"" if entry.payload is None else entry.payload
        if isinstance(entry.message, SessionHeader):
            flight.open(entry.message, payload)
            continue
        for status in entry.message.heard:
            states.add(status, entry.run)
        rerun = flight.record(entry.message, payload)
        if rerun is not None:
            frames.append(rerun)
            times_s.append(entry.run.seconds(entry.message.t_ns))
            show(len(frames))
    return Replay(
        tuple(frames), tuple(flight.reasons), tuple(times_s), tuple(states.changes), tuple(warnings)
    )
