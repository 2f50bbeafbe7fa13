"""Recorder process: Zenoh in, MCAP files out."""

import itertools
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from dfvs_common.progress import warn
from dfvs_core.messages.frame_record import SessionHeader
from dfvs_core.perception.flow_grid import FlowGrid
from dfvs_service.record.follow import Follower
from dfvs_service.record.preparation import prepare_folder
from dfvs_service.record.recorder import RecordCounts, Recorder
from dfvs_service.settings.config import ServiceConfig


@dataclass(frozen=True, slots=True)
class RecordSummary:
    """What a recording came to."""

    folder: str
    name: str
    size_bytes: int
    counts: RecordCounts


def free_name(folder: Path, name: str) -> str:
    """Name of a recording that no other in the folder has: ``name``, ``name.2``, ``name.3``, ..."""
    names = itertools.chain([name], (f"{name}.{number}" for number in itertools.count(2)))
    return next(free for free in names if not any(folder.glob(f"{free}-*.mcap")))


def record(
    config: ServiceConfig, folder: Path, follower: Follower, show: Callable[[Recorder], None]
) -> RecordSummary:
    """Record a vehicle until the follower is told to stop.

    ``folder`` exists; ``show`` is called a few times a second.
    """
    stamp = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
    name = free_name(folder, f"{config.vehicle.name}-{stamp}")
    recorder = Recorder(folder, name, config.record, time.monotonic_ns, warn)
    try:
        for events in follower.events():
            for message, payload in events:
                if isinstance(message, SessionHeader):
                    recorder.open(message, payload)
                elif isinstance(message, FlowGrid):
                    recorder.add_flow(message)
                else:
                    recorder.add(message, payload)
            show(recorder)
    finally:
        recorder.close()
    counts = recorder.counts
    counts.missing += follower.dropped
    if counts.missing or counts.dropped:
        warn(f"the recording lacks {counts.missing + counts.dropped} frame records")
    return RecordSummary(str(folder), name, recorder.size_bytes, counts)


class RecorderProcess:
    """Records the service that started it, in the folder of the settings.

    Raises
    ------
    ConfigError
        If the folder cannot be used.
    """

    def __init__(self, config: ServiceConfig) -> None:
        self._config = config
        self._follower = Follower(config)
        self._folder = prepare_folder(Path(config.record.folder))
        self.stop = self._follower.stop
        """Signal handler: take what has come, then end."""

    def run(self) -> None:
        """Record until told to stop."""
        record(self._config, self._folder, self._follower, lambda _: None)


def progress_text(recorder: Recorder) -> str:
    """What was recorded so far, and where."""
    counts, path = recorder.counts, recorder.path
    where = "waiting for a flight" if path is None else path.name
    lost = counts.missing + counts.dropped
    size_mb = recorder.size_bytes / 1e6
    return f"{counts.records} frame records, {size_mb:.1f} MB, {lost} lost  {where}"
