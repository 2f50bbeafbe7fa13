"""The real ``dfvs-service`` as a user starts it, its processes, its log and its commands."""

import contextlib
import json
import secrets
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import psutil
import zenoh

from dfvs_common.child import start_child
from dfvs_core.errors import DfvsError
from dfvs_core.gate.commands.command import Command, encode_command
from dfvs_core.gate.events import Action
from dfvs_core.messages.topics import Topics

T = TypeVar("T")

KEY = b"the harness signs its orders so."
"""Secret of the signed commands of the harness."""

CHILDREN = ("gate", "perception", "operator_link", "flights")
"""Processes of the service beside its parent; ``flights`` is the black box, where there is one."""

_POLL_S = 0.005
_GRACE_S = 4.0
_STATUS_S = 3.0
"""For the service to publish a state that is waited for."""


class HarnessError(DfvsError):
    """The harness itself could not do what a case needs."""


@dataclass(slots=True)
class GateLog:
    """The gate's own log, read as it grows."""

    path: Path
    changes: list[dict[str, Any]] = field(default_factory=list)
    """All transitions so far."""
    _read: int = 0

    def update(self) -> None:
        """Read what was added."""
        with contextlib.suppress(FileNotFoundError), self.path.open("rb") as file:
            file.seek(self._read)
            data = file.read()
            end = data.rfind(b"\n") + 1
            self._read += end
            records = (json.loads(line) for line in data[:end].splitlines())
            self.changes += [record for record in records if record["kind"] == "transition"]

    def transitions(self, since_ns: int = 0) -> list[dict[str, Any]]:
        """Transitions from a time on, oldest first."""
        self.update()
        return [change for change in self.changes if change["t_ns"] >= since_ns]

    @property
    def state(self) -> str:
        """State after the last transition."""
        self.update()
        return str(self.changes[-1]["target"]) if self.changes else "IDLE"


class ServiceProcess:
    """One run of ``dfvs-service`` with these words, and a runtime folder that is new and empty."""

    def __init__(self, words: list[str], runtime: Path) -> None:
        runtime.mkdir(parents=True)
        self.runtime = runtime
        self.log = GateLog(runtime / "gate.jsonl")
        command = [sys.executable, "-m", "dfvs_service.cli", *words, "--runtime-dir", str(runtime)]
        with (runtime / "service.err").open("wb") as errors:
            self.process = start_child(command, subprocess.DEVNULL, errors)
        self._children: dict[str, psutil.Process] = {}

    def pid(self, name: str) -> int:
        """Process id of ``parent`` or of one of ``CHILDREN``."""
        if name == "parent":
            return self.process.pid
        if name not in self._children:
            self._find_children()
        return self._children[name].pid

    def _find_children(self) -> None:
        for child in psutil.Process(self.process.pid).children():
            words = " ".join(child.cmdline())
            for name in CHILDREN:
                if f"dfvs_service.{name}" in words:
                    self._children[name] = child

    def is_running(self) -> bool:
        """Whether the parent runs."""
        return self.process.poll() is None

    def close(self) -> None:
        """End every process of it, however it is."""
        with contextlib.suppress(psutil.NoSuchProcess):
            self._find_children()
        self.process.send_signal(signal.SIGCONT)
        for child in self._children.values():
            with contextlib.suppress(psutil.NoSuchProcess):
                child.send_signal(signal.SIGCONT)
        self.process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(_GRACE_S)
        for child in self._children.values():
            with contextlib.suppress(psutil.NoSuchProcess):
                child.kill()
        self.process.kill()
        self.process.wait()

    def errors(self) -> str:
        """Standard error of the service."""
        return (self.runtime / "service.err").read_text(errors="replace")


def signed(key: bytes, vehicle: str, action: Action, challenge: str, argument: str = "") -> bytes:
    """Bytes of a command that was never sent before."""
    nonce = secrets.token_hex(16)
    return encode_command(key, Command(vehicle, action, challenge, nonce, argument))


class Operator:
    """Receives the service's state over Zenoh and gives signed commands."""

    def __init__(self, session: zenoh.Session, topics: Topics) -> None:
        self._session = session
        self._topics = topics
        self._changed = threading.Condition()
        self.status: dict[str, Any] = {}
        self.received_ns = 0
        self.challenges: list[str] = []
        """Challenges as the service published them, oldest first."""
        self.last_command = b""
        """Bytes of the last command."""
        self.used_challenge = ""
        """Its challenge."""
        self.seen_ns = 0
        """Capture of the newest frame that perception could use."""
        self._subscribers = [
            session.declare_subscriber(topics.telemetry("state"), self._on_state),
            session.declare_subscriber(topics.telemetry("servo"), self._on_servo),
        ]

    def _on_state(self, sample: zenoh.Sample) -> None:
        with self._changed:
            self.status = json.loads(sample.payload.to_bytes())
            self.received_ns = time.monotonic_ns()
            if (challenge := self.status["challenge"]) and challenge not in self.challenges[-1:]:
                self.challenges.append(challenge)
            self._changed.notify_all()

    def _on_servo(self, sample: zenoh.Sample) -> None:
        servo = json.loads(sample.payload.to_bytes())
        if not servo["reason"]:
            self.seen_ns = servo["t_capture_ns"]

    def _await(self, accept: Callable[[dict[str, Any]], bool]) -> bool:
        """Wait for a state that is accepted; tell whether it came."""
        with self._changed:
            return self._changed.wait_for(lambda: accept(self.status), _STATUS_S)

    def command(self, action: Action) -> str:
        """Give a signed command; returns the service's answer.

        Raises
        ------
        HarnessError
            If it does not answer.
        """
        command = self.signed(action)
        count = self.status["command_count"]
        self.send(command)
        if not self._await(lambda s: s["command_count"] > count):
            raise HarnessError(f"the service does not answer the order {action}")
        return str(self.status["command_result"])

    def signed(self, action: Action) -> bytes:
        """Bytes of a command with the challenge of a state that is published from now on.

        Raises
        ------
        HarnessError
            If there is none.
        """
        since_ns = time.monotonic_ns()
        if not self._await(lambda s: bool(s.get("challenge")) and s["t_ns"] > since_ns):
            raise HarnessError("the service publishes no challenge")
        self.used_challenge = self.status["challenge"]
        self.last_command = signed(KEY, self._topics.vehicle, action, self.used_challenge)
        return self.last_command

    def send(self, command: bytes) -> None:
        """Send the bytes of a command, whatever they are."""
        self._session.put(self._topics.command, command)

    def send_goal(self, goal: bytes, command: bytes) -> None:
        """Send the bytes of a goal with those of its command, whatever they are."""
        self._session.put(self._topics.new_goal, goal, attachment=command)


def wait_until(condition: Callable[[], bool], timeout_s: float, poll_s: float = _POLL_S) -> bool:
    """Wait for a condition; tell whether it came true."""
    deadline = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(poll_s)
    return True


def wait_for_first(found: Callable[[], Sequence[T]], timeout_s: float, problem: str) -> T:
    """First item of what is found, as soon as there is one; else HarnessError with the problem."""
    if not wait_until(lambda: bool(found()), timeout_s):
        raise HarnessError(problem)
    return found()[0]
