"""Flights on disk: one JSON file each, so that a broken run can be taken up again."""

from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from dfvs_bench.drone.bound import TimeBound
from dfvs_bench.trials.documents import read_document, write_document
from dfvs_bench.trials.provenance import input_digest
from dfvs_bench.trials.task import BenchTask, same_poses
from dfvs_common.progress import log
from dfvs_core.gate.limits import VelocityLimits
from dfvs_sim.demo.options import FlightOptions
from dfvs_sim.demo.results.summary import NOT_READY


@dataclass(frozen=True, slots=True)
class Setting:
    """What a run of flights shares."""

    matcher: str
    """Name that ``dfvs-service`` knows it by."""
    service: tuple[str, ...]
    """Further words for ``dfvs-service``."""
    limits: VelocityLimits
    """In force with these words."""
    seed: int
    """Noise of camera and vehicle."""
    revision: str
    options: FlightOptions
    """Of each flight; they have all words for ``dfvs-service``, the matcher's too."""
    config: Path | None = None
    """Settings file of the service, which ``service`` names too."""
    network: str | None = None
    """Bundle of the depth network that these words ask for."""


@dataclass(frozen=True, slots=True)
class FlightRecord:
    """A flight with everything that it depended on; angles in degrees where the name says so."""

    task: str
    difficulty: str
    matcher: str
    service: tuple[str, ...]
    """Words for ``dfvs-service`` beside the matcher."""
    seed: int
    start: tuple[float, ...]
    goal: tuple[float, ...]
    """Both are levelled poses (4, 4) row by row, NED, as planned."""
    size: tuple[int, ...]
    """Width and height of the images, px."""
    overlap: float
    """Share of the goal's pixels that the planned start sees."""
    limits: VelocityLimits
    bound: TimeBound
    initial_translation_m: float
    initial_rotation_deg: float
    """Both from the true pose at the pilot's switch, as the bound; as planned without a flight."""
    end_state: str
    end_cause: str
    """Why the gate ended; its state is ``NOT READY`` where the flight could not be brought up."""
    converged: bool = False
    """The service says DONE, and the camera truly is within 5 cm and 1 degree."""
    final_translation_m: float | None = None
    final_rotation_deg: float | None = None
    """Both by the truth, after the end; None without a flight."""
    servo_s: float | None = None
    """From the pilot's switch until the gate first lets the vehicle move: it engages with zero
    setpoints and waits for the autopilot to confirm.
    """
    within_s: float | None = None
    """From the pilot's switch until the camera truly stays within 5 cm and 1 degree."""
    done_s: float | None = None
    """From the pilot's switch until the service says that it is done, or gives up."""
    path_ratio: float | None = None
    """Way flown over the straight line."""
    version: str = ""
    revision: str = ""
    timeout_s: float = 0.0
    """How long the flight might have taken."""
    inputs: str = ""
    """Hash of scene, intrinsics, networks and settings file; see ``input_digest``."""
    estimate: str | None = "perfect"
    wind: str | None = "calm"
    """Both of the simulated vehicle, see ``Conditions``; None beside another one."""
    autopilot: str | None = None
    """MAVLink URL of a vehicle that ran already; None for the simulated one."""

    @property
    def within_ratio(self) -> float | None:
        """Time to stay within the criterion over the bound, of a flight that converged."""
        return self._over_bound(self.within_s)

    @property
    def motion_ratio(self) -> float | None:
        """The same from the moment when the gate first lets the vehicle move."""
        if self.within_s is None or self.servo_s is None:
            return None
        return self._over_bound(self.within_s - self.servo_s)

    @property
    def done_ratio(self) -> float | None:
        """Time until the service says that it is done over the bound, likewise."""
        return self._over_bound(self.done_s)

    def _over_bound(self, time_s: float | None) -> float | None:
        if time_s is None or not self.converged or self.bound.least_s <= 0:
            return None
        return time_s / self.bound.least_s


def record_path(folder: Path, task: str) -> Path:
    """Where the record of a task lies."""
    return folder / f"{task}.json"


def write_record(folder: Path, record: FlightRecord) -> None:
    """Write a record, whole or not at all."""
    write_document(record_path(folder, record.task), record)


def read_records(folder: Path) -> list[FlightRecord]:
    """Read all records of a folder, in the order of their names.

    A summary of ``dfvs-bench drone --json`` is left out, with a line in the log.

    Raises
    ------
    ConfigError
        If one is damaged.
    """
    records = []
    for path in sorted(folder.glob("*.json")):
        if b'"methods":' in path.read_bytes():
            log(f"{path} is a summary of dfvs-bench drone, no flight: left out")
        else:
            records.append(read_record(path))
    return records


def read_record(path: Path) -> FlightRecord:
    """Read a record.

    Raises
    ------
    ConfigError
        If it is none.
    """
    return read_document(FlightRecord, path, f"record {path}", "a file of dfvs-bench drone")


def fits(record: FlightRecord, task: BenchTask, setting: Setting) -> bool:
    """Tell whether a record is of this very task, with these settings and this program."""
    options = setting.options
    same = (record.matcher, record.service, record.seed, record.limits, record.timeout_s)
    wanted = (setting.matcher, setting.service, setting.seed, setting.limits, options.timeout_s)
    return (
        (record.autopilot, record.estimate, record.wind)
        == (options.autopilot, options.estimate, options.wind)
        and same_poses((record.start, record.goal), task.poses)
        and same == wanted
        and record.version == version("dfvs")
        and record.end_state != NOT_READY
        and record.inputs == input_digest(task, setting.matcher, setting.config, setting.network)
    )
