"""``python -m dfvs_service.operator_link --runtime DIR``: started by the service, not by hand."""

import logging
import sys
from collections.abc import Sequence

from dfvs_service.operator_link.process import OperatorLink
from dfvs_service.supervisor.child_process import prefer_this_process, run_child


def main(argv: Sequence[str] | None = None) -> int:
    """Run the operator link until SIGTERM."""
    logging.basicConfig(level=logging.INFO, format="%(name)s: %(message)s")
    prefer_this_process()
    return run_child("dfvs_service.operator_link", argv, OperatorLink)


if __name__ == "__main__":
    sys.exit(main())
