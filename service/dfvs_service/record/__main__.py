"""``python -m dfvs_service.record --runtime DIR``: started by the service, not by hand."""

import sys

from dfvs_service.record.process import RecorderProcess
from dfvs_service.supervisor.child_process import run_child

if __name__ == "__main__":
    sys.exit(run_child("dfvs_service.record", lambda config, _: RecorderProcess(config)))
