"""``dfvs-service teach``: record a route of goal images from a flight by hand."""

import argparse
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from dfvs_common.command_line import command_parser, require_range
from dfvs_common.lifecycle import EXIT_FAILED, EXIT_OK, stop_event
from dfvs_common.progress import log
from dfvs_core.perception.route import RouteRecordingLimits
from dfvs_service.route.recording import (
    Event,
    RouteRecorder,
    prepare_route_folder,
    route_recording_settings,
)
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.options import add_settings_options, settings_from

_RECEIVE_S = 0.25
_EPILOG = """\
example: dfvs-service teach --out route/ --config service.toml
then:    dfvs-service --goal route/ --config service.toml

Fly the way by hand, slowly; a goal is taken whenever the last one leaves the view. Ctrl-C ends
with a goal at the place reached. Nothing is sent to the vehicle. Exit code: 0 a route was
recorded, 1 none, 2 cannot run.
"""
_REPORT_S = 2.0
"""Time without frames until that is said, and between two lines about bad frames."""


def _parser() -> argparse.ArgumentParser:
    parser = command_parser(
        "dfvs-service teach",
        "Record a route: goal images, each of which is seen from the one before.",
        _EPILOG,
    )
    add_settings_options(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="empty or new")
    parser.add_argument("--mavlink", metavar="URL", help="connection (vehicle.mavlink)")
    parser.add_argument(
        "--overlap", type=float, default=0.55, metavar="SHARE", help="least overlap (default: 0.55)"
    )
    return parser


def run(words: Sequence[str]) -> int:
    """Teach until interrupted; returns the exit code.

    Raises
    ------
    DfvsError
        If folder, camera or vehicle cannot be used.
    """
    arguments = _parser().parse_args(words)
    config = settings_from(arguments, {"vehicle.mavlink": arguments.mavlink})
    require_range(arguments, 0.2, 0.95, "overlap")
    prepare_route_folder(arguments.out)
    limits = RouteRecordingLimits(overlap=arguments.overlap)
    count = _record_route(config, arguments.out, limits)
    print(f"{count} goals in {arguments.out}")
    return EXIT_OK if count else EXIT_FAILED


def _record_route(config: ServiceConfig, folder: Path, limits: RouteRecordingLimits) -> int:
    """Teach until stopped; returns the number of goals."""
    # Zenoh, MAVSDK and the matcher take their time to load.
    from dfvs_service.perception.assembly import Clocks, flow_matcher
    from dfvs_service.route.frame_queue import FrameQueue, known_camera, open_beside
    from dfvs_service.route.vehicle_state import VehicleStateListener

    config = route_recording_settings(config, known_camera(config))
    matcher = flow_matcher(config.flow)
    listener = VehicleStateListener()
    vehicle = config.vehicle
    listener.connect(vehicle.mavlink, vehicle.timeout_s, vehicle.system_id)
    with open_beside(config) as session:
        frames = FrameQueue(session, config, _log)
        clocks = Clocks(frames.clock, time.monotonic_ns, time.monotonic_ns)
        recorder = RouteRecorder(config, folder, matcher, clocks, limits)
        stop = stop_event()  # what waits until here is ended by the signal itself
        progress = RouteProgress(frames.key, _log, time.monotonic)
        while not stop.is_set():
            sample = frames.receive_sample(_RECEIVE_S)
            recorder.on_vehicle_states(listener.new_states(), on_ground=listener.on_ground)
            if sample is None:
                progress.on_silence()
            else:
                event = recorder.process(sample)
                progress.on_frame(event, recorder.count, recorder.refusal)
        if recorder.finish():
            _log(f"goal {recorder.count}, the last one")
    return recorder.count


def _log(text: str) -> None:
    log(f"teach: {text}")


class RouteProgress:
    """Says which goals were taken, why frames are refused, and that none come.

    Frames are awaited at ``key``; ``log`` takes a line, and ``now_s`` gives monotonic s.
    """

    def __init__(self, key: str, log: Callable[[str], None], now_s: Callable[[], float]) -> None:
        self._key = key
        self._log = log
        self._now_s = now_s
        self._received_s = now_s()
        self._warned_s = self._refused_s = self._received_s - _REPORT_S
        self._refusal = ""
        self._is_silence_told = False
        log(f"waiting for frames on {key}")

    def on_silence(self) -> None:
        """No frame came."""
        if self._now_s() - self._received_s >= _REPORT_S and not self._is_silence_told:
            self._is_silence_told = True
            self._log(f"no frames on {self._key}: is the camera publishing?")

    def on_frame(self, event: Event, count: int, refusal: str) -> None:
        """Update by a frame: what it led to, the number of goals, and why it was refused.

        A refusal is said once, until frames are accepted for a while or another reason comes.
        """
        now_s = self._received_s = self._now_s()
        self._is_silence_told = False
        if event is Event.SAVED:
            self._log(f"goal {count}")
        elif event is Event.LOST:
            self._warn(f"goal {count} is out of sight: fly back to where it was taken")
        elif refusal:
            self._refused_s = now_s
            if refusal != self._refusal and self._warn(f"frames are refused: {refusal}"):
                self._refusal = refusal
        if now_s - self._refused_s >= _REPORT_S:
            self._refusal = ""

    def _warn(self, line: str) -> bool:
        """Log a line unless the last one has only just been; returns whether it was logged."""
        now_s = self._now_s()
        if now_s - self._warned_s < _REPORT_S:
            return False
        self._warned_s = now_s
        self._log(line)
        return True
