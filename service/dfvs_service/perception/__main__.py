"""``python -m dfvs_service.perception --runtime DIR``: started by the service, not by hand."""

import logging
import sys
from collections.abc import Sequence

from dfvs_service.perception.process import PerceptionProcess
from dfvs_service.supervisor.child_process import run_child


def main(argv: Sequence[str] | None = None) -> int:
    """Run perception until SIGTERM."""
    logging.basicConfig(level=logging.INFO, format="%(name)s: %(message)s")
    return run_child("dfvs_service.perception", argv, PerceptionProcess)


if __name__ == "__main__":
    sys.exit(main())
