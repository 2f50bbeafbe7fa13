"""``python -m dfvs_service.flights --runtime DIR``: started by the service, not by hand."""

import os
import sys

from dfvs_common.lifecycle import cannot_run
from dfvs_service.flights.process import BlackBoxProcess
from dfvs_service.supervisor.child_process import run_child

_NICENESS = 10

if __name__ == "__main__":
    os.nice(_NICENESS)
    try:
        code = run_child("dfvs_service.flights", BlackBoxProcess)
    except OSError as error:
        code = cannot_run(f"the black box cannot run: {error}")
    sys.exit(code)
