"""One service in one environment: started, disturbed, repaired, started again."""

import contextlib
import math
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from dfvs_common.child import start_child
from dfvs_common.zenoh_session import open_session
from dfvs_core.gate.states import GateState
from dfvs_core.messages.topics import Topics
from dfvs_core.messages.zenoh_settings import ZenohMode
from dfvs_robustness.harness.environment import Environment
from dfvs_robustness.harness.records import Run
from dfvs_robustness.harness.service import HarnessError, Operator, ServiceProcess, wait_until
from dfvs_robustness.harness.setup import NO_RESPONSE_CHECK, Setup
from dfvs_sim.demo.flight.ports import LOOPBACK, any_port
from dfvs_sim.vehicle.modes import Mode

STARTUP_S, STATE_S = 40.0, 12.0
_MOVING_M_S = 0.05


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
        self.camera = setup.camera(self.rng, lambda p, a: self._publisher.put(p, attachment=a))
        setup.write_inputs(folder, self.camera.wall, self.rng)
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
        self.environment.start(self.camera)
        self.place_far()

    def close(self) -> None:
        """End the service and the environment."""
        self.stop_service()
        self.environment.close()
        self._stack.close()
        self.stop_router()

    @property
    def endpoint(self) -> str:
        """Where the service listens for Zenoh peers."""
        return f"tcp/{LOOPBACK}:{self._zenoh}"

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

    # --- the environment --------------------------------------------------------------------

    def place_far(self) -> None:
        """Put the vehicle somewhere from where the goal is a metre away."""
        back, side, down, yaw = self.places.uniform((0.6, -0.4, -0.2, -0.1), (1.0, 0.4, 0.2, 0.1))
        self.environment.place((-float(back), float(side), float(down)), float(yaw))

    def place_at_goal(self) -> None:
        """Put the vehicle where the goal image was taken."""
        self.environment.place((0.0, 0.0, 0.0), 0.0)

    def repair(self) -> None:
        """Take back whatever a fault did to the environment."""
        self.camera.follow(None)
        for token in self._tokens:
            token.undeclare()
        self._tokens.clear()
        if self.setup.via_router and self._router is None:
            self.start_router()
        if self.environment.repair():
            self.stop_service()

    def hold_token(self, key: str) -> int:
        """Show a Zenoh liveliness token until the environment is repaired; returns when."""
        self._tokens.append(self.session.liveliness().declare_token(key))
        return time.monotonic_ns()

    def start_router(self) -> None:
        """Start a Zenoh router in a process of its own."""
        command = [sys.executable, "-m", "dfvs_robustness.harness.router", self.endpoint]
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
        velocity = self.environment.last("setpoint").get("velocity", ())
        return math.hypot(*velocity) > _MOVING_M_S

    # --- the service ------------------------------------------------------------------------

    def start_service(self, *, silent_vehicle: bool = False) -> None:
        """Start a fresh service and wait for its state.

        With ``silent_vehicle`` it receives nothing of the vehicle until the repair.

        Raises
        ------
        HarnessError
            If it does not come up.
        """
        self.stop_service()
        self.runs += 1
        self.repair()
        self.place_far()
        self.environment.pilot_mode(Mode.HOLD)
        if silent_vehicle:
            self.environment.silence()
        self._run_from, self.disturbed_ns = len(self.environment.events), None
        self._service = ServiceProcess(self.words(), self.folder / f"run-{self.runs}")
        since_ns = time.monotonic_ns()
        if not wait_until(lambda: self.operator.received_ns > since_ns, STARTUP_S):
            raise HarnessError(f"the service does not come up: {self.service.errors()}")

    def stop_service(self) -> None:
        """End the service, if one runs."""
        if self._service is None:
            return
        self._service.close()
        if self.on_run_over is not None:
            run = Run(
                self.environment.events[self._run_from :],
                self._service.log.transitions(),
                list(self.camera.good_ns),
                self._service.runtime / "gate-inputs.jsonl",
                self.disturbed_ns,
                NO_RESPONSE_CHECK not in self.setup.settings,
            )
            self.on_run_over(run)
        self._service = None

    def words(self) -> list[str]:
        """Arguments of ``dfvs-service`` for this harness."""
        link = ["--mavlink", f"udpin://{LOOPBACK}:{self._mavlink}"]
        setup = self.setup.words(self.folder, self.endpoint)
        return ["--vehicle", self.topics.vehicle, *link, *setup]

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
        """Wait for the vehicle's next heartbeat to have reached the service."""
        since_ns = time.monotonic_ns()
        wait_until(lambda: self.environment.last("heartbeat_sent").get("t_ns", 0) > since_ns, 2.0)
        time.sleep(0.02)
