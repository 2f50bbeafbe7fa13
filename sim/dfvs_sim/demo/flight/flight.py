"""One flight: vehicle, camera, pilot and service brought up, flown, and brought down again."""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from dfvs_common.child import Child
from dfvs_common.goal_file import write_goal
from dfvs_common.zenoh_session import open_session
from dfvs_core.errors import DfvsError
from dfvs_core.messages.topics import Topics
from dfvs_sim.camera.mock import MockCamera, MockCameraConfig
from dfvs_sim.demo.flight.camera_link import CameraLink, camera_link
from dfvs_sim.demo.flight.engagement import ENDED, READY, UNDER_WAY, Engagement, engagement_of
from dfvs_sim.demo.flight.flight_log import SETTLE_S, FlightLog
from dfvs_sim.demo.flight.ports import LOOPBACK, FlightPorts
from dfvs_sim.demo.flight.processes import FlightProcesses
from dfvs_sim.demo.flight.system_id import flown_system_id
from dfvs_sim.demo.flight.telemetry import TelemetryWatch
from dfvs_sim.demo.flight.track import Track
from dfvs_sim.demo.options import FlightOptions
from dfvs_sim.demo.plan import FlightPlan
from dfvs_sim.ground.link import DEFAULT_URL, GroundLink
from dfvs_sim.ground.pilot import Pilot, PilotError
from dfvs_sim.ground.pose import PoseTracker
from dfvs_sim.ground.systems import LinkError
from dfvs_sim.vehicle.modes import Mode
from dfvs_sim.viewpoints.poses import CameraPoses

_STARTUP_S = 40.0

Log = Callable[[str], None]


class FlightError(DfvsError):
    """The flight could not be brought up."""


class NotReadyError(FlightError):
    """Everything runs, but the service will not fly, and says why."""


FLIGHT_ERRORS = (FlightError, PilotError, LinkError)
"""Errors of a flight that cannot be brought up, where the next one may."""


@dataclass(frozen=True, slots=True)
class FlightSession:
    """Who is there once the vehicle follows the service."""

    pilot: Pilot
    watch: TelemetryWatch
    track: Track
    service: Child
    camera: MockCamera


class Flight:
    """Everything that one flight needs, from an empty folder to a log.

    The folder exists, and takes goal, logs and records; ``log`` takes one line for the user at
    every step.

    Raises
    ------
    ConfigError
        If the service refuses its words, or would never engage with them.
    """

    def __init__(self, plan: FlightPlan, options: FlightOptions, folder: Path, log: Log) -> None:
        self._plan = plan
        self._options = options
        self._folder = folder
        self._log = log
        self._engagement = engagement_of(options.service)
        self._ports = FlightPorts.choose()
        self._link: CameraLink = camera_link(options.camera, options.vehicle, plan.camera)
        self._processes = FlightProcesses(options, self._ports, self._link, folder, plan.seed)

    def run(self, on_progress: Callable[[TelemetryWatch, Track], None]) -> FlightLog:
        """Fly.

        Raises
        ------
        FlightError, PilotError, LinkError
            If vehicle, pilot or service cannot be brought up; see ``FLIGHT_ERRORS``.
        ConfigError
            If an address cannot be used, which every flight would meet.
        """
        for path, pose in zip(self._goal_images(), self._plan.goals, strict=True):
            write_goal(path, self._plan.goal_image(pose), self._plan.goal_sidecar(pose))
        with contextlib.ExitStack() as stack:
            stack.callback(self._ports.close)
            session = self._start(stack)
            engaged_ns = self._engage(session)
            self.fly(session, on_progress)
            watch = session.watch
            log = FlightLog(
                self._plan,
                self._options,
                session.track,
                watch,
                engaged_ns,
                time.monotonic_ns(),
                watch.state,
                watch.cause,
                self._processes.vehicle_record,
            )
            time.sleep(SETTLE_S)
            self._hold(session.pilot)
            self._options.pause("press Enter to end")
        return log

    def _goal_images(self) -> list[Path]:
        """Where the goals are written: those on the way are numbered, the last is ``goal.png``."""
        via = [f"goal-{number}.png" for number in range(1, len(self._plan.goals))]
        return [self._folder / name for name in (*via, "goal.png")]

    def _start(self, stack: contextlib.ExitStack) -> FlightSession:
        """Start everything, up to a service that is ready beside a vehicle in the air."""
        page = self._dashboard(stack)
        system_id = self._await_system_id(stack)
        link = stack.enter_context(self._ground_link(system_id))
        pilot, tracker = Pilot(link, log=self._log), PoseTracker(link, log=self._log)
        self._await_vehicle(pilot, tracker)
        stack.callback(self._land, pilot)  # once camera and track have stopped
        to_scene = self.take_off(pilot, tracker)
        track = Track(to_scene, self._plan.T_scene_goal)
        session = stack.enter_context(open_session("peer", (self._ports.zenoh_endpoint,)))
        camera = MockCamera(
            self._camera_config(), self._plan.renderer, to_scene, self._link.publisher(session)
        )
        stack.enter_context(running(camera.run, "camera"))
        stack.enter_context(running(track.run, "track"))
        watch = TelemetryWatch(session, Topics(self._options.vehicle))
        self._log("starting dfvs-service")
        service = stack.enter_context(self._processes.service(self._goal_images(), system_id))
        self.await_ready(watch, service, self._engagement.ready_states)
        if page is not None and page.exit_code is not None:
            raise FlightError(f"dfvs-dashboard ended at once:\n{page.last_lines()}")
        return FlightSession(pilot, watch, track, service, camera)

    def _dashboard(self, stack: contextlib.ExitStack) -> Child | None:
        if not self._options.dashboard:
            return None
        self._log(f"dashboard at http://{LOOPBACK}:{self._ports.dashboard}/")
        return stack.enter_context(self._processes.dashboard())

    def _await_system_id(self, stack: contextlib.ExitStack) -> int | None:
        """Start the simulated vehicle, if it is flown; return the id of the one to fly."""
        if self._options.is_simulated:
            stack.enter_context(self._processes.vehicle())
        return flown_system_id(self._options, _STARTUP_S)

    def _ground_link(self, system_id: int | None) -> GroundLink:
        """Ground-station link to the very vehicle that the service will fly."""
        simulated = f"udpin://{LOOPBACK}:{self._ports.ground}"
        usual = simulated if self._options.is_simulated else DEFAULT_URL
        return GroundLink(self._options.ground or usual, system_id)

    def _await_vehicle(self, pilot: Pilot, tracker: PoseTracker) -> None:
        """Wait until the vehicle stands on the ground and can be armed."""
        self._log("waiting for the vehicle")
        tracker.start(_STARTUP_S)
        if not self._options.is_simulated:
            tracker.require_truth()
        if pilot.is_flying():
            self._log("the vehicle flies already: the pilot lands it first")
            pilot.land()
        pilot.prepare()

    def take_off(self, pilot: Pilot, tracker: PoseTracker) -> CameraPoses:
        """Take off; returns poses in a scene in which the hover is the plan's start.

        The scene is placed only then: the vehicle hovers where its estimate puts it.

        Raises
        ------
        PilotError
            If the vehicle does not take off.
        FlightError
            If its pose is not known.
        """
        take_off = self._plan.take_off()
        if take_off.remark:
            self._log(take_off.remark)
        self._log(f"the pilot takes off to {take_off.height_m:.2f} m")
        pilot.take_off(take_off.height_m)
        pose = tracker.pose_at(time.monotonic_ns())
        if pose is None:
            raise FlightError("the vehicle's pose is not known", "LOCAL_POSITION_NED and attitude")
        T_scene_local = self._plan.T_scene_local(pose.T_local_body())
        return tracker.camera_poses(T_scene_local, self._plan.mount.T_body_camera())

    def _hold(self, pilot: Pilot) -> None:
        """Select Hold; where the vehicle refuses, what was flown counts all the same."""
        try:
            pilot.set_mode(Mode.HOLD)
        except DfvsError as error:
            self._log(f"the vehicle is not in Hold: {error}")

    def _land(self, pilot: Pilot) -> None:
        """Land a vehicle that the demo did not start; the simulated one ends with its process."""
        if not self._options.is_simulated and pilot.armed():
            self._log("the pilot lands")
            try:
                pilot.land()
            except DfvsError as error:
                self._log(f"the vehicle is not landed: {error}")

    def _camera_config(self) -> MockCameraConfig:
        return MockCameraConfig(
            self._plan.camera,
            rate_hz=self._options.rate_hz,
            pixel_format=self._link.pixel_format,
            seed=self._plan.seed,
            nice=self._options.camera_nice,
        )

    def await_ready(
        self, watch: TelemetryWatch, service: Child, wanted: frozenset[str] = READY
    ) -> None:
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
            if watch.wait_for_state(wanted, 0.5) is not None:
                return
            if service.exit_code is not None:
                raise FlightError(f"dfvs-service ended at once:\n{service.last_lines()}")
        raise NotReadyError(
            f"dfvs-service is not ready after {self._options.ready_s:g} s "
            f"(state {watch.state or 'unknown'}: {watch.cause or service.last_lines()})"
        )

    def _engage(self, session: FlightSession) -> int:
        """Let the service fly the vehicle; returns when it was engaged (monotonic ns)."""
        if self._engagement is Engagement.PILOT:
            self._options.pause("press Enter to fly")
            self.await_ready(session.watch, session.service)  # it may have been lost meanwhile
            self._log("the pilot switches to OFFBOARD")
            engaged_ns = time.monotonic_ns()
            session.pilot.set_mode(Mode.OFFBOARD)
            return engaged_ns
        self._log(self._waiting_to_engage())
        if session.watch.wait_for_state(UNDER_WAY | ENDED, self._options.timeout_s) is None:
            raise NotReadyError(
                f"dfvs-service does not engage within {self._options.timeout_s:g} s "
                f"(state {session.watch.state}: {session.watch.cause})"
            )
        return session.watch.entered_ns(UNDER_WAY | ENDED)

    def _waiting_to_engage(self) -> str:
        if self._engagement is Engagement.AUTO:
            return "the service engages by itself"
        listen = f"'zenoh.listen=[\"{self._ports.zenoh_endpoint}\"]'"
        return (
            "waiting for a signed command: dfvs-service command engage --key-file KEY "
            f"--vehicle {self._options.vehicle} --set {listen}"
        )

    def fly(
        self, session: FlightSession, on_progress: Callable[[TelemetryWatch, Track], None]
    ) -> None:
        """Wait for the end of the flight that has begun, or for the timeout."""
        deadline = time.monotonic() + self._options.timeout_s
        while time.monotonic() < deadline and session.service.exit_code is None:
            if session.watch.wait_for_state(ENDED, 0.2) is not None:
                return
            on_progress(session.watch, session.track)


@contextlib.contextmanager
def running(work: Callable[[threading.Event], None], name: str) -> Iterator[None]:
    """Run ``work(stop)`` on a thread inside the context."""
    stop = threading.Event()
    thread = threading.Thread(target=work, args=(stop,), name=name, daemon=True)
    try:
        thread.start()  # it waits for the thread, and Ctrl-C may come meanwhile
        yield
    finally:
        stop.set()
        if thread.is_alive():
            thread.join(2.0)
