"""The real parent and gate processes beside a simulated vehicle that hovers already."""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vehicle_process import free_port
from waiting import until

from dfvs_service.settings.config import load_config

HERE = Path(__file__).parent / "components" / "gate"


@dataclass
class HoveringVehicle:
    process: subprocess.Popen[str]
    port: int
    record: Path

    def order(self, line: str) -> int:
        """Let the pilot do something; returns when (monotonic ns)."""
        assert self.process.stdin is not None
        now_ns = time.monotonic_ns()
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        return now_ns

    def events(self, kind: str, since_ns: int = 0) -> list[dict[str, Any]]:
        lines = self.record.read_text().splitlines(keepends=True)
        events = [json.loads(line) for line in lines if line.endswith("\n")]
        return [e for e in events if e["kind"] == kind and e["t_ns"] >= since_ns]


@contextlib.contextmanager
def hovering_vehicle(folder: Path) -> Iterator[HoveringVehicle]:
    port, record = free_port(), folder / "vehicle.jsonl"
    command = [sys.executable, str(HERE / "flying_vehicle.py")]
    process = subprocess.Popen(
        [*command, "--port", str(port), "--record", str(record)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    try:
        assert process.stdout.readline() == "ready\n"
        yield HoveringVehicle(process, port, record)
    finally:
        process.kill()
        process.wait()


@dataclass
class Flight:
    """One run of the service, from its start to its end."""

    vehicle: HoveringVehicle
    folder: Path
    parent: subprocess.Popen[str]
    start_ns: int

    def log(self) -> list[dict[str, Any]]:
        path = self.folder / "gate.jsonl"
        lines = path.read_text().splitlines(keepends=True) if path.exists() else []
        return [json.loads(line) for line in lines if line.endswith("\n")]

    def transitions(self) -> list[dict[str, Any]]:
        return [record for record in self.log() if record["kind"] == "transition"]

    def states(self) -> list[str]:
        return [record["target"] for record in self.transitions()]

    def until(self, state: str, timeout_s: float = 60.0) -> Flight:
        self.wait(lambda: state in self.states(), timeout_s)
        return self

    def wait(self, condition: Callable[[], bool], timeout_s: float = 60.0) -> None:
        assert until(condition, timeout_s), self.log()[-5:]

    def pid(self, name: str) -> int:
        """Process id of the gate or of perception."""
        children = Path(f"/proc/{self.parent.pid}/task/{self.parent.pid}/children").read_text()
        for child in children.split():
            program = Path(f"/proc/{child}/cmdline").read_text().split("--runtime")[0]
            if name in program:
                return int(child)
        raise AssertionError(f"no child {name} among {children}")

    def signal(self, name: str, number: signal.Signals) -> int:
        """Send a signal to the gate or to perception; returns when (monotonic ns)."""
        pid = self.pid(name)
        now_ns = time.monotonic_ns()
        os.kill(pid, number)
        return now_ns

    def end(self, timeout_s: float = 30.0) -> int:
        """Wait for the service's own end; returns its exit code."""
        return self.parent.wait(timeout_s)

    def errors(self) -> str:
        return (self.folder / "parent.err").read_text()

    def error(self) -> str:
        """Give the one error that the user reads."""
        (line,) = [line for line in self.errors().splitlines() if line.startswith("error:")]
        return line

    def setpoints(self, since_ns: int = 0) -> list[dict[str, Any]]:
        return self.vehicle.events("setpoint", max(since_ns, self.start_ns))

    def modes_asked(self) -> list[str]:
        events = self.vehicle.events("mode_command", self.start_ns)
        return [e["mode"] for e in events]

    def settle(self, seconds: float = 0.6) -> Flight:
        """Let time pass in which something wrong could still happen."""
        time.sleep(seconds)
        return self


def speed(setpoint: dict[str, Any]) -> float:
    vx, vy, vz = setpoint["velocity"]
    return math.hypot(vx, vy, vz) + abs(setpoint["yaw_rate_rad_s"])


@contextlib.contextmanager
def service_running(
    vehicle: HoveringVehicle,
    folder: Path,
    *,
    gate: str = "",
    sees: str = "--forward 30",
    **settings: Any,
) -> Iterator[Flight]:
    """The service with a stand-in for perception (``sees``); settings as section__key."""
    folder.mkdir(exist_ok=True)
    overrides = {
        "camera.horizontal_fov_deg": 80,
        "camera.width": 640,
        "camera.height": 480,
        "vehicle.mavlink": f"udpin://127.0.0.1:{vehicle.port}",
        "gate.engage": "auto",
        "gate.exit_when_done": True,
        "limits.max_distance_m": 40,
        "zenoh.listen": [],
        **{name.replace("__", "."): value for name, value in settings.items()},
    }
    (folder / "config.json").write_text(load_config(None, overrides).to_json())
    vehicle.order("mode HOLD")
    command = [sys.executable, str(HERE / "run_parent.py"), "--runtime", str(folder)]
    command += ["--perception", f"{HERE / 'fake_perception.py'} {sees}"]
    command += ["--gate", str(HERE / gate)] if gate else []
    start_ns = time.monotonic_ns()
    with (folder / "parent.err").open("w") as errors:
        parent = subprocess.Popen(command, stderr=errors, text=True)
    flight = Flight(vehicle, folder, parent, start_ns)
    try:
        yield flight
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.kill(parent.pid, signal.SIGCONT)
        parent.terminate()
        try:
            parent.wait(20.0)
        except subprocess.TimeoutExpired:
            parent.kill()
            parent.wait()


def side_by_side(
    scenario: Callable[[HoveringVehicle, Path, str], None], folder: Path, kinds: tuple[str, ...]
) -> None:
    """Run a scenario once for every kind, at the same time, each with a vehicle of its own."""

    def run(kind: str) -> None:
        place = folder / kind.replace(" ", "-")
        place.mkdir()
        with hovering_vehicle(place) as vehicle:
            scenario(vehicle, place, kind)

    with ThreadPoolExecutor(len(kinds)) as pool:
        for future in [pool.submit(run, kind) for kind in kinds]:
            future.result()
