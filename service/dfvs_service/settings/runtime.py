"""Runtime folder of the service's processes: settings, goal, sockets, logs."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from dfvs_core.errors import ConfigError

_MAX_SOCKET_PATH = 100
"""Linux allows 107 bytes; the longest name in the folder is part of it."""

Child = Literal["gate", "perception", "operator_link", "recorder", "black-box"]
"""A process of the service that may write to standard error."""


@dataclass(frozen=True, slots=True)
class RuntimeFolder:
    """Paths inside the runtime folder."""

    path: Path

    def __post_init__(self) -> None:
        """Refuse a folder whose name is too long for a socket's address."""
        if len(str(self.perception_socket).encode()) > _MAX_SOCKET_PATH:
            raise ConfigError(
                f"the runtime folder {str(self.path)!r} has too long a name for Unix sockets",
                f"at most {_MAX_SOCKET_PATH - len('/perception.sock')} bytes",
                "choose another one with --runtime-dir",
            )

    @property
    def config(self) -> Path:
        """Resolved settings."""
        return self.path / "config.json"

    @property
    def goal_image(self) -> Path:
        """Goal as PNG; its sidecar lies beside it."""
        return self.path / "goal.png"

    def later_goal(self, number: int) -> Path:
        """Goal that follows the first one, from 1, as PNG with its sidecar."""
        return self.path / f"goal-{number:04d}.png"

    def later_goals(self) -> list[Path]:
        """Goals that follow the first one, in their order."""
        return sorted(self.path.glob("goal-[0-9][0-9][0-9][0-9].png"))

    @property
    def gate_socket(self) -> Path:
        """Where the gate listens for perception."""
        return self.path / "gate.sock"

    @property
    def perception_socket(self) -> Path:
        """Where perception listens for the gate."""
        return self.path / "perception.sock"

    @property
    def link_socket(self) -> Path:
        """Where the operator link listens for the gate."""
        return self.path / "link.sock"

    @property
    def zenoh_socket(self) -> Path:
        """Where the operator link offers Zenoh to the other processes of the service."""
        return self.path / "zenoh.sock"

    @property
    def new_goals(self) -> Path:
        """Folder of goals that operators sent."""
        return self.path / "new-goals"

    @property
    def parent_socket(self) -> Path:
        """Where the parent listens for the gate's heartbeats."""
        return self.path / "parent.sock"

    @property
    def gate_log(self) -> Path:
        """JSON lines: transitions with their causes, mode requests, warnings."""
        return self.path / "gate.jsonl"

    @property
    def gate_inputs(self) -> Path:
        """Everything that the gate decided by, for a replay."""
        return self.path / "gate-inputs.jsonl"

    @property
    def service_log(self) -> Path:
        """JSON lines: all lines of the parent to the user, and the exit code."""
        return self.path / "service.jsonl"

    @property
    def black_box_socket(self) -> Path:
        """Where the black box listens for telemetry."""
        return self.path / "black-box.sock"

    @property
    def gate_scratch(self) -> Path:
        """Folder of the temporary files of the gate's libraries, emptied at each start."""
        return self.path / "gate-scratch"

    def stderr(self, child: Child) -> Path:
        """What a child process writes to its standard error."""
        return self.path / f"{child}.err"

    def stderr_files(self) -> list[Path]:
        """Files of :meth:`stderr` of the children that were started."""
        return [path for path in map(self.stderr, get_args(Child)) if path.exists()]
