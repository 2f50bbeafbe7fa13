"""Runtime folder of the service's processes: settings, goal, sockets, logs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from dfvs_core.errors import ConfigError

_MAX_SOCKET_PATH = 100
"""Linux allows 107 bytes; the longest name in the folder is part of it."""

Child = Literal["gate", "perception", "operator_link", "recorder", "black-box"]
"""A process of the service that may write to standard error."""


class _Inside:
    """Path of a name in a runtime folder."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, folder: RuntimeFolder, _owner: type) -> Path:
        return folder.path / self._name


@dataclass(frozen=True, slots=True)
class RuntimeFolder:
    """Paths inside the runtime folder."""

    path: Path

    config = _Inside("config.json")
    """Resolved settings."""
    goal_image = _Inside("goal.png")
    """Goal as PNG; its sidecar lies beside it."""
    gate_socket = _Inside("gate.sock")
    """Where the gate listens for perception."""
    perception_socket = _Inside("perception.sock")
    """Where perception listens for the gate."""
    link_socket = _Inside("link.sock")
    """Where the operator link listens for the gate."""
    zenoh_socket = _Inside("zenoh.sock")
    """Where the operator link offers Zenoh to the other processes of the service."""
    new_goals = _Inside("new-goals")
    """Folder of goals that operators sent."""
    parent_socket = _Inside("parent.sock")
    """Where the parent listens for the gate's heartbeats."""
    gate_log = _Inside("gate.jsonl")
    """JSON lines: transitions with their causes, mode requests, warnings."""
    gate_inputs = _Inside("gate-inputs.jsonl")
    """Everything that the gate decided by, for a replay."""
    service_log = _Inside("service.jsonl")
    """JSON lines: all lines of the parent to the user, and the exit code."""
    black_box_socket = _Inside("black-box.sock")
    """Where the black box listens for telemetry."""
    gate_scratch = _Inside("gate-scratch")
    """Folder of the temporary files of the gate's libraries, emptied at each start."""

    def __post_init__(self) -> None:
        """Refuse a folder whose name is too long for a socket's address."""
        if len(str(self.perception_socket).encode()) > _MAX_SOCKET_PATH:
            raise ConfigError(
                f"the runtime folder {str(self.path)!r} has too long a name for Unix sockets",
                f"at most {_MAX_SOCKET_PATH - len('/perception.sock')} bytes",
                "choose another one with --runtime-dir",
            )

    def later_goal(self, number: int) -> Path:
        """Goal that follows the first one, from 1, as PNG with its sidecar."""
        return self.path / f"goal-{number:04d}.png"

    def later_goals(self) -> list[Path]:
        """Goals that follow the first one, in their order."""
        return sorted(self.path.glob("goal-[0-9][0-9][0-9][0-9].png"))

    def stderr(self, child: Child) -> Path:
        """What a child process writes to its standard error."""
        return self.path / f"{child}.err"

    def stderr_files(self) -> list[Path]:
        """Files of :meth:`stderr` of the children that were started."""
        return [path for path in map(self.stderr, get_args(Child)) if path.exists()]
