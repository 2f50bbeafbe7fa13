"""Name lease of a vehicle: services that stand by for it or command it (invariant I6).

Every service shows a Zenoh liveliness token that vanishes with it, and a second one while its
gate is engaged. Whoever sees another service's tokens does not engage; whoever is engaged and
sees another that is, aborts. This process only receives and reports: the gate judges.
"""

import secrets
import threading
import time
from collections.abc import Callable

import zenoh

from dfvs_core.gate.states import ENGAGED
from dfvs_core.messages.link import LeaseHolders
from dfvs_core.messages.topics import Topics

STANDBY, IN_COMMAND = "standby", "engaged"

_REPEAT_NS = 1_000_000_000
"""The gate takes a silence of ``GateTiming.services_age_ns`` as the end of this watch."""

_MAX_NAMES = 8


class NameLease:
    """Our tokens, and those of others.

    ``session`` is open as long as the lease is held. ``notify`` takes what is known of others, for
    the gate. ``watches``: only monitor others, and show them nothing.
    """

    def __init__(
        self,
        session: zenoh.Session,
        topics: Topics,
        notify: Callable[[LeaseHolders], None],
        *,
        watches: bool = False,
    ) -> None:
        self.name = secrets.token_hex(4)
        self._liveliness = session.liveliness()
        self._topics = topics
        self._notify = notify
        self._lock = threading.Lock()
        self._others: dict[str, set[str]] = {STANDBY: set(), IN_COMMAND: set()}
        self._notified: LeaseHolders | None = None
        self._notified_ns = 0
        self._standby = None if watches else self._declare(STANDBY)
        self._in_command: zenoh.LivelinessToken | None = None
        self._subscriber = self._liveliness.declare_subscriber(
            topics.lease("*", "*"), self._on_change, history=True
        )

    def show(self, state: str) -> None:
        """Show others whether our gate is engaged."""
        if (state in ENGAGED) is (self._in_command is not None):
            return
        if self._in_command is None:
            self._in_command = self._declare(IN_COMMAND)
        else:
            self._in_command.undeclare()  # type: ignore[no-untyped-call]
            self._in_command = None

    def notify(self) -> None:
        """Report others to the gate: every change at once, and again every second."""
        holders, now_ns = self.holders(), time.monotonic_ns()
        if holders != self._notified or now_ns - self._notified_ns >= _REPEAT_NS:
            self._notified, self._notified_ns = holders, now_ns
            self._notify(holders)

    def holders(self) -> LeaseHolders:
        """Names of the others, sorted; of a crowd only the first few."""
        with self._lock:
            standing_by = sorted(self._others[STANDBY])[:_MAX_NAMES]
            engaged = sorted(self._others[IN_COMMAND])[:_MAX_NAMES]
        return LeaseHolders(tuple(standing_by), tuple(engaged))

    def close(self) -> None:
        """Give the lease back."""
        for held in (self._subscriber, self._standby, self._in_command):
            if held is not None:
                held.undeclare()  # type: ignore[no-untyped-call]

    def _declare(self, part: str) -> zenoh.LivelinessToken:
        return self._liveliness.declare_token(self._topics.lease(part, self.name))

    def _on_change(self, sample: zenoh.Sample) -> None:
        """Zenoh's thread: a token appeared or vanished."""
        *_, part, name = str(sample.key_expr).split("/")
        if name == self.name or part not in self._others:
            return
        with self._lock:
            if sample.kind == zenoh.SampleKind.PUT:
                self._others[part].add(name[:32])
            else:
                self._others[part].discard(name[:32])
