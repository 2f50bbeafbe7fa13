"""Several vehicles at a time: one ``dfvs-demo`` process each, and one table."""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dfvs_common.child import end_all
from dfvs_common.lifecycle import child_environment

MOST_VEHICLES = 4
NO_FLIGHT = "no flight"
"""Instead of a gate's state, where there is no summary."""

_GRACE_S = 20.0
"""For landing and ending everything, after an interrupt."""


@dataclass(frozen=True, slots=True)
class Member:
    """One vehicle of a fleet, with the words for its own ``dfvs-demo``."""

    name: str
    """Of the vehicle in the Zenoh keys."""
    system_id: int
    seed: int
    """Draws start, goal and noise."""
    folder: Path
    """Takes its results."""
    words: tuple[str, ...]
    """Further words for ``dfvs-demo``; those of this member come behind them and count."""

    @property
    def command(self) -> list[str]:
        """Command that flies it."""
        own = [
            *("--vehicles", "1", "--name", self.name, "--system-id", str(self.system_id)),
            *("--seed", str(self.seed), "--out", str(self.folder)),
            *("--json", str(self.summary)),
        ]
        return [sys.executable, "-m", "dfvs_sim.demo.cli", *self.words, *own]

    @property
    def summary(self) -> Path:
        """Where its flight leaves the figures."""
        return self.folder / "summary.json"

    def document(self) -> dict[str, Any]:
        """Summary as JSON has it, or one that says that there was no flight."""
        try:
            document = json.loads(self.summary.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            document = {"vehicle": self.name, "seed": self.seed, "converged": False}
            document["end_state"] = NO_FLIGHT
        return dict(document)


def fly_together(members: Sequence[Member], log: Callable[[str], None]) -> list[int]:
    """Fly all members, whose folders exist, at the same time; returns their exit codes.

    ``log`` takes a line of a member's output behind its name; it is called from several threads,
    one at a time.
    """
    lock = threading.Lock()

    def relay(member: Member, process: subprocess.Popen[str]) -> None:
        for line in process.stderr or ():
            with lock:
                log(f"{member.name}: {line.rstrip()}")

    processes = [_start(member) for member in members]
    relays = [
        threading.Thread(target=relay, args=pair, daemon=True)
        for pair in zip(members, processes, strict=True)
    ]
    try:
        for thread in relays:
            thread.start()
        return [process.wait() for process in processes]
    finally:
        end_all(processes, _GRACE_S)
        for thread in relays:
            thread.join(_GRACE_S)


def _start(member: Member) -> subprocess.Popen[str]:
    """Start a member's flight in a session of its own: a terminal's interrupt is for us alone."""
    member.summary.unlink(missing_ok=True)
    return subprocess.Popen(
        member.command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | child_environment(),
        start_new_session=True,
    )
