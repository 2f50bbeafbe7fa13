"""``python -m dfvs_service.record --runtime DIR``: started by the service, not by hand."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from types import FrameType

from dfvs_service.child_process import run_child
from dfvs_service.config import ServiceConfig
from dfvs_service.record.follow import Follower
from dfvs_service.record.preparation import prepare_folder
from dfvs_service.record.process import record
from dfvs_service.runtime import RuntimeFolder


class Recorder:
    """Recording of one service until it is told to stop."""

    def __init__(self, config: ServiceConfig, _runtime: RuntimeFolder) -> None:
        self._config = config
        self._follower = Follower(config)

    def stop(self, number: int, frame: FrameType | None) -> None:
        """Signal handler: record what has come, then end."""
        self._follower.stop(number, frame)

    def run(self) -> None:
        """Record."""
        folder = prepare_folder(Path(self._config.record.folder))
        record(self._config, folder, self._follower, lambda _: None)


def main(argv: Sequence[str] | None = None) -> int:
    """Record until SIGTERM."""
    return run_child("dfvs_service.record", argv, Recorder)


if __name__ == "__main__":
    sys.exit(main())
