"""What the service tells over Zenoh during a flight, collected as it comes."""

import json
import threading
import time
from typing import Any

import zenoh

from dfvs_core.messages.topics import Topics


class TelemetryWatch:
    """Keeps every state and servo document and the newest timing of one vehicle."""

    def __init__(self, session: zenoh.Session, topics: Topics) -> None:
        self._changed = threading.Condition()
        self.servo: list[dict[str, Any]] = []
        self.states: list[tuple[int, str]] = []
        """(monotonic ns of arrival, state) whenever the state changed."""
        self.status: dict[str, Any] = {}
        self.timing: dict[str, Any] = {}
        streams = {
            "state": self._on_state,
            "servo": self._on_servo,
            "timing": self._on_timing,
        }
        self._subscribers = [
            session.declare_subscriber(topics.telemetry(name), callback)
            for name, callback in streams.items()
        ]

    @property
    def state(self) -> str:
        """The gate's state, empty before the first word of it."""
        return str(self.status.get("state", ""))

    @property
    def cause(self) -> str:
        """Why the gate is in its state."""
        return str(self.status.get("cause", ""))

    def wait_for_state(self, wanted: frozenset[str], timeout_s: float) -> str | None:
        """State once it is one of the wanted ones, or None after the timeout."""
        with self._changed:
            reached = self._changed.wait_for(lambda: self.state in wanted, timeout_s)
            return self.state if reached else None

    def entered_ns(self, states: frozenset[str]) -> int:
        """When the first of these states was entered (monotonic ns of its arrival).

        Raises
        ------
        ValueError
            If none of them was.
        """
        with self._changed:
            return min(t_ns for t_ns, state in self.states if state in states)

    def _on_state(self, sample: zenoh.Sample) -> None:
        status = json.loads(sample.payload.to_bytes())
        with self._changed:
            if status["state"] != self.state:
                self.states.append((time.monotonic_ns(), status["state"]))
            self.status = status
            self._changed.notify_all()

    def _on_servo(self, sample: zenoh.Sample) -> None:
        self.servo.append(json.loads(sample.payload.to_bytes()))

    def _on_timing(self, sample: zenoh.Sample) -> None:
        self.timing = json.loads(sample.payload.to_bytes())
