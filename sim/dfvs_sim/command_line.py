"""How every command line of the simulator ends: an exit code, and one line where it cannot run."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from dfvs_core.errors import DfvsError

EXIT_CANNOT_RUN = 2
EXIT_INTERRUPTED = 130


def run_command(parser: argparse.ArgumentParser, argv: Sequence[str] | None) -> int:
    """Parse, call the chosen command's ``run(args)``, and turn errors into exit codes."""
    args = parser.parse_args(argv)
    try:
        return int(args.run(args))
    except DfvsError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_CANNOT_RUN
    except OSError as error:  # a full disk, a folder without rights
        where = f"{error.filename}: " if error.filename else ""
        print(f"error: {where}{error.strerror or error}", file=sys.stderr)
        return EXIT_CANNOT_RUN
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
