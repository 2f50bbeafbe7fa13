"""Preparation of a flight: resolved settings, checks before a start, runtime folder, programs."""

import fcntl
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from dfvs_common.progress import warn
from dfvs_core.errors import ConfigError
from dfvs_core.gate.config import Engage
from dfvs_core.messages.goal import Goal, GoalSidecar, Mount
from dfvs_service.flights.store import flights_folder
from dfvs_service.ports import require_free_mavlink_port, require_free_zenoh_ports
from dfvs_service.preflight.calibration import camera_check
from dfvs_service.record.preparation import prepare_folder, require_record_extra
from dfvs_service.settings.calibration_file import with_calibration, with_intrinsics
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.goal_file import checked_goal, read_image, read_sidecar
from dfvs_service.settings.key_file import load_key
from dfvs_service.settings.runtime import RuntimeFolder
from dfvs_service.supervisor.console import ChangeLines, Display, JsonLines, LiveLine
from dfvs_service.supervisor.parent import Programs


def resolve(config: ServiceConfig, goal_path: Path) -> tuple[ServiceConfig, Goal]:
    """Settings with all that is known of the camera, and the goal, checked against it."""
    image, sidecar = read_image(goal_path), read_sidecar(goal_path)
    height, width = image.shape[:2]
    config = _with_announced(with_calibration(config))
    config, camera = config.with_camera((width, height), sidecar)
    if sidecar is None:
        sidecar = GoalSidecar(camera, mount=config.camera.mount or Mount())
    return config, checked_goal(goal_path, image, sidecar)


def resolve_route(
    config: ServiceConfig, goal_paths: Sequence[Path]
) -> tuple[ServiceConfig, list[tuple[Path, Goal]]]:
    """Settings with all that is known of the camera, and each goal of a route with its image.

    What the settings do not say of the camera is as in the first goal's sidecar.
    """
    first, *others = goal_paths
    config, goal = resolve(config, first)
    return config, [(first, goal), *((path, resolve(config, path)[1]) for path in others)]


def check_commands(config: ServiceConfig) -> None:
    """Refuse a key that cannot be used, and to wait for commands that nobody can sign."""
    if config.gate.command_key_file:
        load_key(Path(config.gate.command_key_file))
    elif config.gate.engage is Engage.COMMAND:
        raise ConfigError(
            "gate.engage is 'command', but there is no key",
            "gate.command_key_file",
            "make one with dfvs-service command new-key, or engage by the pilot's switch",
        )


def check_ports(config: ServiceConfig) -> None:
    """Refuse ports of other programs before anything is started: MAVSDK would share its own."""
    require_free_zenoh_ports(config.zenoh)
    require_free_mavlink_port(config.vehicle.mavlink)


def check_camera(config: ServiceConfig, goal_path: Path, goal: Goal) -> None:
    """Refuse a goal of another camera than the one that flies."""
    check = camera_check(config, goal)
    if check.refuses:
        raise ConfigError(f"goal image {goal_path}: {check.detail}", remedy=check.remedy)


def _with_announced(config: ServiceConfig) -> ServiceConfig:
    """Settings with the intrinsics that the camera announces, where they have none."""
    if config.camera.announced_s <= 0 or config.camera.model() is not None:
        return config
    # Zenoh is needed here alone, and takes its time to load.
    from dfvs_service.perception.announced import await_camera

    camera = await_camera(config)
    return config if camera is None else with_intrinsics(config, camera)


def with_flights_folder(config: ServiceConfig) -> ServiceConfig:
    """Settings that name the folder of flights; without a black box where none is known."""
    if not config.black_box.enabled:
        return config
    try:
        folder = flights_folder(config.black_box, os.environ)
    except ConfigError as error:
        warn(f"no black box: {error}")
        return replace(config, black_box=replace(config.black_box, enabled=False))
    return replace(config, black_box=replace(config.black_box, folder=str(folder)))


def programs_of(config: ServiceConfig) -> Programs:
    """Programs of the flight, with a black box, and a recorder where a recording is asked for.

    Raises
    ------
    ConfigError
        If recordings cannot be made here.
    """
    programs = Programs()
    if config.black_box.enabled:
        programs = replace(programs, black_box=(sys.executable, "-m", "dfvs_service.flights"))
    if config.record.folder:
        require_record_extra()
        prepare_folder(Path(config.record.folder))
        programs = replace(programs, recorder=(sys.executable, "-m", "dfvs_service.record"))
    return programs


def with_model(config: ServiceConfig, goal: Goal) -> ServiceConfig:
    """Settings with a working size, by a model that can be used: the errors come before a start."""
    # ONNX Runtime is needed here alone, and takes its time to load.
    from dfvs_service.perception.assembly import depth_network, flow_matcher
    from dfvs_service.perception.working_size import with_working_size

    depth_network(config)
    return with_working_size(config, goal, flow_matcher(config.flow), time.monotonic_ns)


@contextmanager
def runtime_folder(folder: Path | None) -> Iterator[RuntimeFolder]:
    """Private runtime folder: the given one, kept, or a temporary one."""
    if folder is None:
        with tempfile.TemporaryDirectory(prefix="dfvs-", ignore_cleanup_errors=True) as temporary:
            yield RuntimeFolder(Path(temporary))
        return
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        lock = (folder / "lock").open("w")
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise ConfigError(
            f"the runtime folder {folder} is used by another dfvs-service",
            remedy=f"end it, or choose another folder: --runtime-dir {folder}-2",
        ) from error
    except OSError as error:
        raise ConfigError(
            f"the runtime folder {folder} cannot be used ({error.strerror})",
            "a writable folder that no other service uses",
        ) from error
    with lock:
        yield RuntimeFolder(folder)


def display_of(runtime: RuntimeFolder, *, as_json: bool) -> Display:
    """Display for the terminal: JSON lines, one live line, or a line a change."""
    if as_json:
        return JsonLines(runtime.gate_log, sys.stdout)
    if sys.stderr.isatty():
        return LiveLine(sys.stderr, shutil.get_terminal_size().columns)
    return ChangeLines(sys.stderr)
