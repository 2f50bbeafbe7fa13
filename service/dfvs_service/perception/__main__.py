"""``python -m dfvs_service.perception --runtime DIR``: started by the service, not by hand."""

import logging
import sys

from dfvs_service.perception.process import PerceptionProcess
from dfvs_service.supervisor.child_process import run_child

if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(name)s: %(message)s")
    sys.exit(run_child("dfvs_service.perception", PerceptionProcess))
