"""Goal after goal with one and the same service: to and fro, each time to another view nearby."""

import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dfvs_common.child import Child
from dfvs_common.goal_file import write_goal
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import pose_error
from dfvs_robustness.soak.holds import Hold, explain
from dfvs_robustness.soak.sampling import Sampler
from dfvs_sim.demo.flight.flight import Flight, FlightError, FlightSession, Log, running
from dfvs_sim.demo.flight.telemetry import TelemetryWatch
from dfvs_sim.demo.flight.track import Track
from dfvs_sim.demo.options import USUAL_ESTIMATE, VEHICLE_NAME, Conditions, FlightOptions
from dfvs_sim.demo.plan import FlightPlan
from dfvs_sim.vehicle.modes import Mode
from dfvs_sim.viewpoints.poses import camera_pose

_STRAY_M, _STRAY_RAD = 0.1, 0.05
_COMMAND_S = 20.0
_CAMERA_NICE = 5
_ENDED_S = 2.0
"""A flight that ends in ABORT is over after so long; before that it cannot be engaged again."""
_MOST_MISSES = 10
_UNDER_WAY = frozenset({"ENGAGE", "SERVO", "HOLD"})


@dataclass(frozen=True, slots=True)
class Leg:
    """One flight to one goal; ``error_m`` and ``error_rad`` are true, at its end."""

    number: int
    state: str
    cause: str
    duration_s: float
    error_m: float
    error_rad: float


@dataclass(frozen=True, slots=True)
class MissionOptions:
    """How long to fly, where records go, frames a second, further words for ``dfvs-service``."""

    folder: Path
    minutes: float
    rate_hz: float
    service: tuple[str, ...]


class Mission(Flight):
    """A flight that goes on from goal to goal, by signed commands, until the time is over.

    It goes to and fro between places near the plan's start and goal. The folder, which exists,
    takes goals, logs and records; ``log`` takes one line for the user at every step.
    """

    def __init__(self, plan: FlightPlan, mission: MissionOptions, log: Log) -> None:
        self._key = mission.folder / "soak.key"
        self._runtime = mission.folder / "runtime"
        words = ("--set", f"gate.command_key_file={self._key}", "--runtime-dir", str(self._runtime))
        service = *words, *mission.service
        options = FlightOptions(
            rate_hz=mission.rate_hz,
            camera_nice=_CAMERA_NICE,
            service=service,
            conditions=Conditions(USUAL_ESTIMATE),
        )
        super().__init__(plan, options, mission.folder, log)
        for old in (self._key, self._runtime / "gate.jsonl"):  # of an earlier soak
            old.unlink(missing_ok=True)
        self._command("new-key")
        self._length_s = 60.0 * mission.minutes
        self._rng = np.random.default_rng(plan.seed)
        self.legs: list[Leg] = []
        self.holds: list[Hold] = []
        self.sampler: Sampler | None = None

    def fly(
        self, session: FlightSession, on_progress: Callable[[TelemetryWatch, Track], None]
    ) -> None:
        """Fly leg after leg, with a sampler beside."""
        self.sampler = Sampler(session.service.pid, lambda: _latency_ms(session.watch))
        end_s = time.monotonic() + self._length_s
        goals = self._goals()
        goal, misses = next(goals), 0
        with running(self.sampler.run, "sampler"):
            while True:
                arrived = self._leg(session, goal, on_progress)
                misses = 0 if arrived else misses + 1
                is_over = time.monotonic() >= end_s or session.service.exit_code is not None
                if is_over or misses >= _MOST_MISSES:
                    return
                if arrived:
                    goal = next(goals)
                    self._change_goal(session, goal)
                else:
                    self._start_again(session)

    @property
    def folder(self) -> Path:
        """Where logs and plots lie."""
        return self._folder

    def _holds_since(self, t_ns: int, session: FlightSession) -> Iterator[Hold]:
        """Every change from SERVO to HOLD since a time, from the gate's log."""
        log = self._runtime / "gate.jsonl"
        for line in log.read_text(encoding="utf-8").splitlines():
            record = json.loads(line)
            path = record.get("source"), record.get("target")
            if record["t_ns"] >= t_ns and path == ("SERVO", "HOLD"):
                cause = f"{record['cause']} {record['detail']}".strip()
                sent = tuple(session.camera.published_ns)
                yield explain(record["t_ns"], cause, sent, session.watch.servo)

    def _goals(self) -> Iterator[FloatArray]:
        """Goal of each leg: the planned one, then near the start and near the goal in turn."""
        yield self._plan.T_scene_goal
        while True:
            yield self._near(self._plan.T_scene_start)
            yield self._near(self._plan.T_scene_goal)

    def _near(self, T_scene_place: FloatArray) -> FloatArray:
        """Level camera pose a little beside a place."""
        x, y, z = T_scene_place[:3, 3] + self._rng.uniform(-_STRAY_M, _STRAY_M, 3)
        ahead = T_scene_place[:3, 2]
        yaw = float(np.arctan2(ahead[1], ahead[0]) + self._rng.uniform(-_STRAY_RAD, _STRAY_RAD))
        return camera_pose((float(x), float(y), float(z)), yaw)

    def _leg(
        self,
        session: FlightSession,
        T_scene_goal: FloatArray,
        on_progress: Callable[[TelemetryWatch, Track], None],
    ) -> bool:
        """Fly to one goal; tell whether it was reached."""
        session.watch.servo.clear()  # hours of them are not needed
        session.track.points[:-1] = []
        began_ns = time.monotonic_ns()
        super().fly(session, on_progress)
        self.holds += self._holds_since(began_ns, session)
        error_m, error_rad = pose_error(session.track.points[-1].T_scene_camera, T_scene_goal)
        leg = Leg(
            len(self.legs) + 1,
            session.watch.state,
            session.watch.cause,
            round((time.monotonic_ns() - began_ns) * 1e-9, 1),
            round(error_m, 4),
            round(error_rad, 4),
        )
        self.legs.append(leg)
        self._log(f"leg {leg.number}: {leg.state} after {leg.duration_s} s, {error_m:.3f} m")
        return leg.state == "DONE"

    def _change_goal(self, session: FlightSession, T_scene_goal: FloatArray) -> None:
        """Order the service to another goal, and wait until it has set off."""
        goal = self._folder / "next.png"
        write_goal(goal, self._plan.goal_image(T_scene_goal), self._plan.goal_sidecar(T_scene_goal))
        self._command("goal", "--goal", str(goal))
        self._await_under_way(session)

    def _start_again(self, session: FlightSession) -> None:
        """Take the vehicle back after a leg that failed, and engage once more."""
        session.pilot.set_mode(Mode.HOLD)
        time.sleep(_ENDED_S)
        self._command("engage")
        self.await_ready(session.watch, session.service)
        session.pilot.set_mode(Mode.OFFBOARD)
        self._await_under_way(session)

    def _await_under_way(self, session: FlightSession) -> None:
        if session.watch.wait_for_state(_UNDER_WAY, _COMMAND_S) is None:
            raise FlightError(f"the service does not set off: {session.watch.state}")

    def _command(self, *words: str) -> None:
        """Run ``dfvs-service command``."""
        listen = f'zenoh.listen=["{self._ports.zenoh_endpoint}"]'
        words = (*words, "--key-file", str(self._key), "--vehicle", VEHICLE_NAME, "--set", listen)
        log = self._folder / "command.log"
        with Child("order", ["dfvs_service.cli", "command", *words], log) as command:
            if command.wait(_COMMAND_S) != 0:
                raise FlightError(f"dfvs-service command {words[0]} failed: {command.last_lines()}")


def _latency_ms(watch: TelemetryWatch) -> tuple[float, float] | None:
    """Newest p50 and p99 from capture to report."""
    stage = watch.timing.get("stages", {}).get("capture_to_report")
    return None if stage is None else (float(stage["p50_ms"]), float(stage["p99_ms"]))
