"""``python -m dfvs_service.flights --runtime DIR``: started by the service, not by hand."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from dfvs_core.errors import DfvsError
from dfvs_service.config import config_from_json
from dfvs_service.flights.process import BlackBoxProcess
from dfvs_service.runtime import RuntimeFolder

EXIT_CANNOT_RUN = 2
_NICENESS = 10


def main(argv: Sequence[str] | None = None) -> int:
    """Keep a flight until SIGTERM."""
    parser = argparse.ArgumentParser(prog="dfvs_service.flights", description=__doc__)
    parser.add_argument("--runtime", type=Path, required=True)
    runtime = RuntimeFolder(parser.parse_args(argv).runtime)
    # The terminal's Ctrl-C goes to all processes; the parent passes it on as SIGTERM.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    os.nice(_NICENESS)
    try:
        config = config_from_json(runtime.config.read_text(encoding="utf-8"))
        box = BlackBoxProcess(config, runtime)
        signal.signal(signal.SIGTERM, box.stop)
        box.run()
    except (DfvsError, OSError) as error:
        print(f"warning: the black box cannot run: {error}", file=sys.stderr)
        return EXIT_CANNOT_RUN
    return 0


if __name__ == "__main__":
    sys.exit(main())
