"""``python -m dfvs_service.flights --runtime DIR``: started by the service, not by hand."""

import os
import sys
from collections.abc import Sequence

from dfvs_common.lifecycle import cannot_run
from dfvs_service.flights.process import BlackBoxProcess
from dfvs_service.supervisor.child_process import run_child

_NICENESS = 10


def main(argv: Sequence[str] | None = None) -> int:
    """Keep a flight until SIGTERM."""
    os.nice(_NICENESS)
    try:
        return run_child("dfvs_service.flights", argv, BlackBoxProcess)
    except OSError as error:
        return cannot_run(f"the black box cannot run: {error}")


if __name__ == "__main__":
    sys.exit(main())
