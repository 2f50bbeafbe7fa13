"""Store of new goals between operator link and perception."""

import contextlib
from pathlib import Path

from dfvs_common.atomic_file import write_atomic
from dfvs_core.errors import WireError
from dfvs_core.messages.goal_command import goal_digest

MAX_KEPT_GOALS = 4


class GoalStore:
    """Keeps the bytes of the newest goals, unopened, by their digest.

    The process that keeps them remembers their order; another one may pop them.

    ``folder`` is private, and made where it is missing.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._kept: list[str] = []
        """Digests of the goals that were kept, oldest first."""

    def keep(self, digest: str, data: bytes) -> None:
        """Keep a goal; the oldest beyond ``MAX_KEPT_GOALS`` are removed.

        Raises
        ------
        OSError
            If it cannot be written.
        """
        self._folder.mkdir(mode=0o700, exist_ok=True)
        write_atomic(self._folder / digest, data)
        self._kept = [each for each in self._kept if each != digest] + [digest]
        while len(self._kept) > MAX_KEPT_GOALS:
            (self._folder / self._kept.pop(0)).unlink(missing_ok=True)

    def pop(self, digest: str) -> bytes:
        """Give away the goal that the gate accepted.

        Raises
        ------
        WireError
            If it is not kept, or damaged.
        """
        data = b""
        with contextlib.suppress(FileNotFoundError):
            data = (self._folder / digest).read_bytes()
        if goal_digest(data) != digest:
            raise WireError(f"goal {digest[:12]!r} is not here")
        return data
