"""``python -m dfvs_service.flights --runtime DIR``: started by the service, not by hand."""

import sys

from dfvs_common.lifecycle import cannot_run, give_way_to_flights
from dfvs_service.flights.process import BlackBoxProcess
from dfvs_service.supervisor.child_process import run_child

if __name__ == "__main__":
    give_way_to_flights()
    try:
        code = run_child("dfvs_service.flights", BlackBoxProcess)
    except OSError as error:
        code = cannot_run(f"the black box cannot run: {error}")
    sys.exit(code)
