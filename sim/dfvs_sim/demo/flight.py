"""One flight: vehicle, camera, pilot and service brought up, flown, and brought down again."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from dfvs_core.arrays import FloatArray
from dfvs_core.errors import DfvsError
from dfvs_core.topics import Topics
from dfvs_core.wire.picture import encode_png
from dfvs_sim.camera.mock import MockCamera, MockCameraConfig, Publish
from dfvs_sim.demo.cameras import CameraLink, camera_link
from dfvs_sim.demo.children import Child
from dfvs_sim.demo.pace import service_threads
from dfvs_sim.demo.plan import FlightPlan
from dfvs_sim.demo.ports import LOOPBACK, FlightPorts
from dfvs_sim.demo.track import Track
from dfvs_sim.demo.watch import TelemetryWatch
from dfvs_sim.ground.link import GroundLink
from dfvs_sim.ground.pilot import Pilot
from dfvs_sim.ground.pose import PoseTracker
from dfvs_sim.zenoh_session import open_peer

ENDED = frozenset({"DONE", "ABORT", "RELEASED"})
READY = frozenset({"READY"})
VEHICLE_NAME = "demo"
_STARTUP_S = 40.0
_SETTLE_S = 1.0

Narrate = Callable[[str], None]


class FlightError(DfvsError):
    """The flight could not be brought up."""


class NotReadyError(FlightError):
    """Everything runs, but the service will not fly, and says why."""


@dataclass(frozen=True, slots=True)
class FlightOptions:
    """How to fly.

    ``ready_s`` is how long the service may take to be ready, ``timeout_s`` how long to arrive.
    ``autopilot`` is the MAVLink URL of a vehicle that runs already, and ``ground`` that of its
    ground-station link; None starts the simulated one. ``service`` holds further words for
    ``dfvs-service``; ``camera`` says how frames travel (see ``CAMERAS``), ``camera_nice`` how far
    the simulated one gives way to the service. With ``dashboard`` the
    flight can be watched in a browser; ``pause`` is then called before it and after it, with what
    the user may do.
    """

    height_m: float = 1.5
    timeout_s: float = 90.0
    ready_s: float = 40.0
    rate_hz: float = 15.0
    camera_nice: int = 0
    autopilot: str | None = None
    ground: str | None = None
    service: tuple[str, ...] = ()
    camera: str = "dfvs"
    dashboard: bool = False
    pause: Callable[[str], None] = lambda _: None


@dataclass(frozen=True, slots=True)
class FlightLog:
    """What is known after a flight."""

    plan: FlightPlan
    track: Track
    watch: TelemetryWatch
    engaged_ns: int
    ended_ns: int
    end_state: str
    end_cause: str
    vehicle_record: Path | None


@dataclass(frozen=True, slots=True)
class Crew:
    """Who is there once the vehicle follows the service."""

    pilot: Pilot
    watch: TelemetryWatch
    track: Track
    service: Child
    camera: MockCamera


class Flight:
    """Everything that one flight needs, from an empty folder to a log.

    Parameters
    ----------
    plan : FlightPlan
    options : FlightOptions
    folder : Path
        Exists; takes goal, logs and records.
    narrate : callable
        Takes one line for the user at every step.
    """

    def __init__(
        self, plan: FlightPlan, options: FlightOptions, folder: Path, narrate: Narrate
    ) -> None:
        self._plan = plan
        self._options = options
        self._folder = folder
        self._narrate = narrate
        self._ports = FlightPorts.choose()
        self._link: CameraLink = camera_link(options.camera, VEHICLE_NAME, plan.camera)
        self._record = None if options.autopilot else folder / "vehicle.jsonl"

    def run(self, on_progress: Callable[[TelemetryWatch, Track], None]) -> FlightLog:
        """Fly.

        Raises
        ------
        DfvsError
            If vehicle, pilot or service cannot be brought up.
        """
        self._write_goals()
        with contextlib.ExitStack() as stack:
            page = stack.enter_context(self._dashboard()) if self._options.dashboard else None
            if self._options.autopilot is None:
                stack.enter_context(self._vehicle())
            link = stack.enter_context(GroundLink(self._ground_url()))
            pilot, tracker = Pilot(link), PoseTracker(link)
            self._narrate("waiting for the vehicle")
            tracker.start(_STARTUP_S)
            pilot.prepare()
            to_scene = self._anchor(tracker)
            track = Track(to_scene, self._plan.T_scene_goal)
            session = stack.enter_context(open_peer(self._ports.zenoh_endpoint))
            camera = self._camera(to_scene, self._link.publisher(session))
            stack.enter_context(running(camera.run, "camera"))
            self._narrate(f"the pilot takes off to {self._options.height_m:g} m")
            pilot.take_off(self._options.height_m)
            watch = TelemetryWatch(session, Topics(VEHICLE_NAME))
            self._narrate("starting dfvs-service")
            service = stack.enter_context(self._service())
            self.await_ready(watch, service)
            if page is not None and page.exit_code is not None:
                raise FlightError(f"dfvs-dashboard ended at once:\n{page.last_lines()}")
            self._options.pause("press Enter to fly")
            self.await_ready(watch, service)  # it may have been lost meanwhile
            stack.enter_context(running(track.run, "track"))
            self._narrate("the pilot switches to OFFBOARD")
            engaged_ns = time.monotonic_ns()
            pilot.engage_offboard()
            self.fly(Crew(pilot, watch, track, service, camera), on_progress)
            ended_ns = time.monotonic_ns()
            time.sleep(_SETTLE_S)
            log = FlightLog(
                self._plan,
                track,
                watch,
                engaged_ns,
                ended_ns,
                watch.state,
                watch.cause,
                self._record,
            )
            pilot.hold()
            self._options.pause("press Enter to end")
        return log

    def _goal_pictures(self) -> list[Path]:
        """Where the goals are written: those on the way are numbered, the last is ``goal.png``."""
        via = [f"goal-{number}.png" for number in range(1, len(self._plan.goals))]
        return [self._folder / name for name in (*via, "goal.png")]

    def _write_goals(self) -> None:
        for path, pose in zip(self._goal_pictures(), self._plan.goals, strict=True):
            path.write_bytes(encode_png(self._plan.goal_image(pose)))
            sidecar = self._plan.goal_sidecar(pose).to_json()
            path.with_suffix(".json").write_text(sidecar, encoding="utf-8")

    def _dashboard(self) -> Child:
        """Serve the page that shows the flight."""
        port = str(self._ports.dashboard)
        words = ["dfvs_service.dashboard.cli", "--port", port]
        words += ["--connect", self._ports.zenoh_endpoint]
        child = Child("dashboard", words, self._folder / "dashboard.log")
        self._narrate(f"dashboard at http://{LOOPBACK}:{port}/")
        return child

    def _vehicle(self) -> Child:
        words = [
            *("dfvs_sim.cli", "vehicle", "--seed", str(self._plan.seed)),
            *("--companion-port", str(self._ports.companion), "--companion-local-port", "0"),
            *("--gcs-port", str(self._ports.ground), "--gcs-local-port", "0"),
            *("--record", str(self._record)),
        ]
        return Child("vehicle", words, self._folder / "vehicle.log")

    def _service(self) -> Child:
        mavlink = self._options.autopilot or f"udpin://{LOOPBACK}:{self._ports.companion}"
        words = [
            *("dfvs_service.cli", "--goal", *map(str, self._goal_pictures())),
            *("--vehicle", VEHICLE_NAME, "--mavlink", mavlink),
            *("--set", f'zenoh.listen=["{self._ports.zenoh_endpoint}"]'),
            *("--set", f"flow.threads={service_threads()}"),
            *self._link.service_words,
            *self._options.service,
        ]
        return Child("service", words, self._folder / "service.log")

    def _ground_url(self) -> str:
        if self._options.ground is not None:
            return self._options.ground
        return f"udpin://{LOOPBACK}:{self._ports.ground}"

    def _anchor(self, tracker: PoseTracker) -> Callable[[int], FloatArray | None]:
        """Place the local frame in the scene; gives the camera's pose there at a time."""
        pose = tracker.pose_at(time.monotonic_ns())
        if pose is None:
            raise FlightError("the vehicle's pose is not known", "LOCAL_POSITION_NED and attitude")
        T_scene_local = self._plan.T_scene_local(pose.T_local_body(), self._options.height_m)
        T_body_camera = self._plan.mount.T_body_camera()

        def T_scene_camera(t_ns: int) -> FloatArray | None:
            now = tracker.pose_at(t_ns)
            return None if now is None else T_scene_local @ now.T_local_body() @ T_body_camera

        return T_scene_camera

    def _camera(
        self,
        T_scene_camera: Callable[[int], FloatArray | None],
        publish: Publish,
    ) -> MockCamera:
        config = MockCameraConfig(
            self._plan.camera,
            rate_hz=self._options.rate_hz,
            pixel_format=self._link.pixel_format,
            seed=self._plan.seed,
            nice=self._options.camera_nice,
        )
        return MockCamera(config, self._plan.renderer, T_scene_camera, publish)

    def await_ready(self, watch: TelemetryWatch, service: Child) -> None:
        """Wait until the service is ready.

        Raises
        ------
        NotReadyError
            If it is not in time.
        FlightError
            If it has ended.
        """
        deadline = time.monotonic() + self._options.ready_s
        while time.monotonic() < deadline:
            if watch.wait_for_state(READY, 0.5) is not None:
                return
            if service.exit_code is not None:
                raise FlightError(f"dfvs-service ended at once:\n{service.last_lines()}")
        raise NotReadyError(
            f"dfvs-service is not ready after {self._options.ready_s:g} s "
            f"(state {watch.state or 'unknown'}: {watch.cause or service.last_lines()})"
        )

    def fly(self, crew: Crew, on_progress: Callable[[TelemetryWatch, Track], None]) -> None:
        """Wait for the end of the flight that has begun, or for the timeout."""
        deadline = time.monotonic() + self._options.timeout_s
        while time.monotonic() < deadline and crew.service.exit_code is None:
            if crew.watch.wait_for_state(ENDED, 0.2) is not None:
                return
            on_progress(crew.watch, crew.track)


@contextlib.contextmanager
def running(work: Callable[[threading.Event], None], name: str) -> Iterator[None]:
    """Run ``work(stop)`` on a thread inside the context."""
    stop = threading.Event()
    thread = threading.Thread(target=work, args=(stop,), name=name, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join(2.0)
