"""Replay of a whole recording, with the reasons why results may differ."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dfvs_core.matching.matcher import Matcher
from dfvs_core.messages.frame_record import FrameRecord, SessionHeader
from dfvs_service.flights.records import StateChange
from dfvs_service.perception.assembly import depth_network, flow_matcher, perception_files
from dfvs_service.perception.build import build_versions
from dfvs_service.perception.frame_processor import ProcessedFrame
from dfvs_service.replay.identity import reasons_to_differ
from dfvs_service.replay.recording import StateLog, read_recording
from dfvs_service.replay.rerun import Rerun, Rerunner, recorded_settings
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.sections import FlowSection


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
        self._rerunner: Rerunner | None = None
        self._run: tuple[str, int] | None = None
        self._matcher: tuple[FlowSection, Matcher] | None = None
        self._build = build_versions()
        self._next_record = 0
        self.reasons: dict[str, None] = {}

    @property
    def processed(self) -> ProcessedFrame | None:
        """What became of the newest sample, None before the first one."""
        return None if self._rerunner is None else self._rerunner.processed

    def open(self, header: SessionHeader, image: bytes) -> None:
        """Build perception for the frame records to come; in the same run, go on to its goal.

        Raises
        ------
        DfvsError
            If settings or model cannot be used.
        """
        config = self._trial.applied_to(recorded_settings(header))
        flow = config.flow
        model = perception_files(config)
        for reason in reasons_to_differ(header, config, model, self._build):
            self.reasons[reason] = None
        if self._rerunner is not None and header.run == self._run:
            self._rerunner.set_goal(header, image, config)
            return
        self._run, self._next_record = header.run, 0
        if self._matcher is None or self._matcher[0] != flow:
            self._matcher = (flow, flow_matcher(flow))
        depth = depth_network(config)
        self._rerunner = Rerunner(header, image, config, self._matcher[1], depth)

    def record(self, record: FrameRecord, payload: bytes) -> Rerun | None:
        """Run one frame record again; None for one that saw nothing."""
        if self._rerunner is None:
            return None
        if record.number != self._next_record:
            missing = record.number - self._next_record
            self.reasons[
                f"{missing} frame records before frame record {record.number} were not recorded"
            ] = None
        self._next_record = record.number + 1
        return self._rerunner.record(record, payload)


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
        tuple(frames),
        tuple(flight.reasons),
        tuple(times_s),
        tuple(states.changes),
        tuple(warnings),
    )
