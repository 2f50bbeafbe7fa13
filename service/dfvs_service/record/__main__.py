"""``python -m dfvs_service.record --runtime DIR``: started by the service, not by hand."""

import sys
from collections.abc import Sequence

from dfvs_service.record.process import RecorderProcess
from dfvs_service.supervisor.child_process import run_child


def main(argv: Sequence[str] | None = None) -> int:
    """Record until SIGTERM."""
    return run_child("dfvs_service.record", argv, lambda config, _: RecorderProcess(config))


if __name__ == "__main__":
    sys.exit(main())
