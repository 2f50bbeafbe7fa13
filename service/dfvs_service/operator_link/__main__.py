"""``python -m dfvs_service.operator_link --runtime DIR``: started by the service, not by hand."""

import logging
import sys

from dfvs_service.operator_link.process import OperatorLink
from dfvs_service.supervisor.child_process import prefer_this_process, run_child

if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(name)s: %(message)s")
    prefer_this_process()
    sys.exit(run_child("dfvs_service.operator_link", OperatorLink))
