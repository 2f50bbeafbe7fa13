"""One service in one world: started, disturbed, healed, started again."""

from __future__ import annotations

import contextlib
import math
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dfvs_common.child import start_child
from dfvs_common.goal_file import write_goal
from dfvs_common.zenoh_session import open_session
from dfvs_core.gate.states import GateState
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import PixelFormat
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_core.messages.topics import Topics
from dfvs_core.messages.zenoh_settings import ZenohMode
from dfvs_robustness.faults import network
from dfvs_robustness.faults.camera import ScriptedCamera
from dfvs_robustness.faults.environment import Environment
from dfvs_robustness.faults.records import Run
from dfvs_robustness.faults.service import KEY, HarnessError, Operator, ServiceProcess, wait_until
from dfvs_robustness.faults.wall import Pose, Wall, noise_texture, ramp_texture
from dfvs_sim.demo.flight.ports import LOOPBACK, any_port
from dfvs_sim.vehicle.modes import Mode

CAMERA = CameraModel.from_horizontal_fov(network.WIDTH, network.HEIGHT, math.radians(75.0))

STARTUP_S, STATE_S = 40.0, 12.0
_MOVING_M_S = 0.05
NO_RESPONSE_CHECK = "gate.response_s=0"
"""Setting of flights without the initial-response check."""

_CALM = (
    *("servo.depth='constant'", "servo.constant_depth_m=3.0", "flow.threads=1"),
    *("telemetry.state_hz=20", "telemetry.preview_hz=0", "telemetry.flow_hz=0"),
    *("limits.max_distance_m=1000", "limits.max_engaged_s=3600", "gate.hold_visual_s=3600"),
    *("gate.engage='command'", "black_box.enabled=false"),
)


@dataclass(frozen=True, slots=True)
class Setup:
    """What kind of service a case needs: ``settings`` are further ``--set`` words.

    ``sees`` is ``texture`` (classical matcher, JPEG) or ``ramp`` (a network, raw pixels).
    """

    sees: str = "ramp"
    settings: tuple[str, ...] = ()
    other_goal: bool = False
    """The goal picture shows another wall."""
    mount: Mount = field(default_factory=Mount)
    """How the goal's sidecar says that the camera is mounted; it looks straight ahead."""
    via_router: bool = False
    """Service and camera meet through a Zenoh router."""
    matcher: str = "classical"
    """Model that sees the texture."""


class Harness:
    """Environment, camera, operator and service of one setup, in a folder of their own."""

    def __init__(self, setup: Setup, folder: Path, seed: int) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.setup = setup
        self.folder = folder
        self.rng = np.random.default_rng(seed)
        """Of the camera's noise and the vehicle; where the vehicle is put, until a case says."""
        self.topics = Topics("faults")
        self._mavlink = any_port(socket.SOCK_DGRAM)
        self._zenoh = any_port(socket.SOCK_STREAM)
        self.runs = 0
        self.environment = Environment(folder / "vehicle.jsonl", self._mavlink, self.rng)
        self._stack = contextlib.ExitStack()
        self._router: subprocess.Popen[bytes] | None = None
        if setup.via_router:
            self.start_router()
        mode: ZenohMode = "client" if setup.via_router else "peer"
        self.session = self._stack.enter_context(open_session(mode, (self.endpoint,)))
        self._publisher = self.session.declare_publisher(self.topics.camera)
        self.environment.camera = self._make_camera()
        self._write_goal()
        self.operator = Operator(self.session, self.topics)
        self._tokens: list[Any] = []
        self.on_run_over: Callable[[Run], None] | None = None
        """Takes the records of every run of the service, once it is over."""
        self.disturbed_ns: int | None = None
        """When the gate of this run was stopped on purpose."""
        self.places = self.rng
        """Where the vehicle is put; a case gives a generator of its own seed."""
        self._run_from = 0
        self._service: ServiceProcess | None = None
        self.environment.start()
        self.place_far()

    def close(self) -> None:
        """End the service and the world."""
        self.stop_service()
        self.environment.close()
        self._stack.close()
        self.stop_router()

    @property
    def endpoint(self) -> str:
        """Where the service listens for Zenoh peers."""
        return f"tcp/{LOOPBACK}:{self._zenoh}"

    @property
    def camera(self) -> ScriptedCamera:
        """The scripted camera."""
        if self.environment.camera is None:
            raise HarnessError("the world has no camera")
        return self.environment.camera

    @property
    def service(self) -> ServiceProcess:
        """The present run of the service."""
        if self._service is None:
            raise HarnessError("no service runs")
        return self._service

    @property
    def state(self) -> GateState:
        """State of the gate by its own log."""
        return GateState(self.service.log.state)

    # --- the world --------------------------------------------------------------------------

    def place_far(self) -> None:
        """Put the vehicle somewhere from where the goal is a metre away."""
        back, side, down, yaw = self.places.uniform((0.6, -0.4, -0.2, -0.1), (1.0, 0.4, 0.2, 0.1))
        self.environment.place((-float(back), float(side), float(down)), float(yaw))

    def place_at_goal(self) -> None:
        """Put the vehicle where the goal picture was taken."""
        self.environment.place((0.0, 0.0, 0.0), 0.0)

    def heal(self) -> None:
        """Take back whatever a fault did to the world."""
        self.camera.film(None)
        for token in self._tokens:
            token.undeclare()
        self._tokens.clear()
        if self.setup.via_router and self._router is None:
            self.start_router()
        if self.environment.repair():
            self.stop_service()

    def hold_token(self, key: str) -> None:
        """Show a Zenoh liveliness token until the world is healed."""
        self._tokens.append(self.session.liveliness().declare_token(key))

    def start_router(self) -> None:
        """Start a Zenoh router in a process of its own."""
        command = [sys.executable, "-m", "dfvs_robustness.faults.router", self.endpoint]
        self._router = start_child(command, subprocess.PIPE, None)
        if self._router.stdout is None or self._router.stdout.readline() != b"ready\n":
            raise HarnessError("the Zenoh router does not start")

    def stop_router(self) -> None:
        """Kill the router, if there is one."""
        if self._router is not None:
            self._router.kill()
            self._router.wait()
            self._router = None

    def is_moving(self) -> bool:
        """Whether the last setpoint at the vehicle was not nearly zero."""
        for event in reversed(self.environment.events):
            if event["kind"] == "setpoint":
                return math.hypot(*event["velocity"]) > _MOVING_M_S
        return False

    # --- the service ------------------------------------------------------------------------

    def start_service(self, *, silent_vehicle: bool = False) -> None:
        """Start a fresh service and wait for its state.

        With ``silent_vehicle`` it hears nothing of the vehicle, until the world is healed.

        Raises
        ------
        HarnessError
            If it does not come up.
        """
        self.stop_service()
        self.runs += 1
        self.heal()
        self.place_far()
        self.environment.pilot_mode(Mode.HOLD)
        if silent_vehicle:
            self.environment.silence()
        self._run_from, self.disturbed_ns = len(self.environment.events), None
        self._service = ServiceProcess(self.words(), self.folder / f"run-{self.runs}")
        since_ns = time.monotonic_ns()
        if not wait_until(lambda: self.operator.heard_ns > since_ns, STARTUP_S):
            raise HarnessError(f"the service does not come up: {self.service.errors()}")

    def stop_service(self) -> None:
        """End the service, if one runs."""
        if self._service is None:
            return
        self._service.close()
        if self.on_run_over is not None:
            self.on_run_over(self._records(self._service))
        self._service = None

    def _records(self, service: ServiceProcess) -> Run:
        """Everything that was recorded while a service ran."""
        return Run(
            self.environment.events[self._run_from :],
            service.log.transitions(),
            list(self.camera.good_ns),
            service.runtime / "gate-inputs.jsonl",
            self.disturbed_ns,
            NO_RESPONSE_CHECK not in self.setup.settings,
        )

    def words(self) -> list[str]:
        """Arguments of ``dfvs-service`` for this rig."""
        words = ["--goal", str(self.folder / "goal.png"), "--vehicle", self.topics.vehicle]
        words += ["--mavlink", f"udpin://{LOOPBACK}:{self._mavlink}"]
        is_texture = self.setup.sees == "texture"
        words += ["--model", self.setup.matcher if is_texture else self._bundle()]
        listen = f"zenoh.listen=['{self.endpoint}']"
        if self.setup.via_router:
            words += ["--set", "zenoh.mode='client'"]
            listen = f"zenoh.connect=['{self.endpoint}']"
        key = f"gate.command_key_file='{self.folder / 'key'}'"
        for setting in (*_CALM, listen, key, *self.setup.settings):
            words += ["--set", setting]
        return words

    def ensure_service(self) -> None:
        """Start a service unless one runs."""
        if self._service is None or not self._service.is_running():
            self.start_service()

    def await_state(self, *states: GateState, timeout_s: float = STATE_S) -> None:
        """Wait for one of the states.

        Raises
        ------
        HarnessError
            If it is not reached in time.
        """
        if not wait_until(lambda: self.state in states, timeout_s):
            cause = self.operator.status.get("cause", "")
            wanted = " or ".join(states)
            raise HarnessError(f"the gate is in {self.state} ({cause}), not in {wanted}")

    def await_goal_in_view(self) -> None:
        """Wait until perception has used a frame of now.

        Raises
        ------
        HarnessError
            If it does not.
        """
        since_ns = time.monotonic_ns()
        if not wait_until(lambda: self.operator.seen_ns >= since_ns, STATE_S):
            raise HarnessError(f"perception uses no frame in {self.state}")

    def await_heartbeat(self) -> None:
        """Wait for the vehicle's next heartbeat to have been heard by the service."""
        since_ns = time.monotonic_ns()
        wait_until(
            lambda: any(
                e["kind"] == "heartbeat_sent" and e["t_ns"] > since_ns
                for e in self.environment.events[-400:]
            ),
            2.0,
        )
        time.sleep(0.02)

    # --- what never changes -----------------------------------------------------------------

    def _make_camera(self) -> ScriptedCamera:
        is_ramp = self.setup.sees == "ramp"
        texture = ramp_texture() if is_ramp else noise_texture(np.random.default_rng(7))
        pixel_format = PixelFormat.RGB8 if is_ramp else PixelFormat.JPEG
        wall = Wall(texture, CAMERA, self.rng)
        return ScriptedCamera(wall, pixel_format, lambda p, a: self._publisher.put(p, attachment=a))

    def _write_goal(self) -> None:
        wall = self.camera.wall
        if self.setup.other_goal:
            wall = Wall(noise_texture(np.random.default_rng(8)), CAMERA, self.rng)
        sidecar = GoalSidecar(CAMERA, mount=self.setup.mount)
        write_goal(self.folder / "goal.png", wall.render(Pose()), sidecar)
        key = self.folder / "key"
        key.write_bytes(KEY)
        key.chmod(0o600)

    def _bundle(self) -> str:
        folder = self.folder / "bundle"
        if not folder.exists():
            network.write_bundle(folder)
        return str(folder)

    def clear(self) -> None:
        """Remove what was written."""
        shutil.rmtree(self.folder, ignore_errors=True)
