"""``python -m dfvs_service.operator_link --runtime DIR``: started by the service, not by hand."""

from __future__ import annotations

import argparse
import logging
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from dfvs_core.errors import DfvsError
from dfvs_service.config import config_from_json
from dfvs_service.operator_link.process import OperatorLink
from dfvs_service.priority import prefer_this_process
from dfvs_service.runtime import RuntimeFolder

EXIT_CANNOT_RUN = 2


def main(argv: Sequence[str] | None = None) -> int:
    """Run the operator link until SIGTERM."""
    parser = argparse.ArgumentParser(prog="dfvs_service.operator_link", description=__doc__)
    parser.add_argument("--runtime", type=Path, required=True)
    runtime = RuntimeFolder(parser.parse_args(argv).runtime)
    logging.basicConfig(level=logging.INFO, format="%(name)s: %(message)s")
    # The terminal's Ctrl-C goes to all processes; the parent passes it on as SIGTERM.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    prefer_this_process()
    try:
        config = config_from_json(runtime.config.read_text(encoding="utf-8"))
        link = OperatorLink(config, runtime)
        signal.signal(signal.SIGTERM, link.stop)
        link.run()
    except DfvsError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_CANNOT_RUN
    return 0


if __name__ == "__main__":
    sys.exit(main())
