"""Runtime folder of the service's processes: settings, goal, sockets, logs."""

from pathlib import Path
from typing import Literal, get_args

from dfvs_core.errors import ConfigError

_MAX_SOCKET_PATH = 100
"""Linux allows 107 bytes; the longest name in the folder is part of it."""

Child = Literal["gate", "perception", "operator_link", "recorder", "black-box"]
"""A process of the service that may write to standard error."""


class RuntimeFolder:
    """Paths inside the runtime folder.

    Raises
    ------
    ConfigError
        If its name is too long for a socket's address.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.config = path / "config.json"
        """Resolved settings."""
        self.goal_image = path / "goal.png"
        """Goal as PNG; its sidecar lies beside it."""
        self.gate_socket = path / "gate.sock"
        """Where the gate listens for perception."""
        self.perception_socket = path / "perception.sock"
        """Where perception listens for the gate."""
        self.link_socket = path / "link.sock"
        """Where the operator link listens for the gate."""
        self.zenoh_socket = path / "zenoh.sock"
        """Where the operator link offers Zenoh to the other processes of the service."""
        self.new_goals = path / "new-goals"
        """Folder of goals that operators sent."""
        self.parent_socket = path / "parent.sock"
        """Where the parent listens for the gate's heartbeats."""
        self.gate_log = path / "gate.jsonl"
        """JSON lines: transitions with their causes, mode requests, warnings."""
        self.gate_inputs = path / "gate-inputs.jsonl"
        """Everything that the gate decided by, for a replay."""
        self.service_log = path / "service.jsonl"
        """JSON lines: all lines of the parent to the user, and the exit code."""
        self.black_box_socket = path / "black-box.sock"
        """Where the black box listens for telemetry."""
        self.gate_scratch = path / "gate-scratch"
        """Folder of the temporary files of the gate's libraries, emptied at each start."""
        if len(str(self.perception_socket).encode()) > _MAX_SOCKET_PATH:
            raise ConfigError(
                f"the runtime folder {str(path)!r} has too long a name for Unix sockets",
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
