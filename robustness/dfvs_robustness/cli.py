"""``dfvs-robustness``: the fault matrix, fuzzing, soak runs and answer times."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from dfvs_common.command_line import run_program
from dfvs_robustness.commands import answers, faults, fuzz, soak

_EPILOG = """examples:
  dfvs-robustness faults --seeds 1 --workers 2         disturb the real service, and judge it
  dfvs-robustness fuzz gate --events 1000000           random inputs for the gate
  dfvs-robustness soak --minutes 60                    one long flight, and its memory
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; 0 when it worked, 2 when it cannot run, with one line that says why."""
    return run_program(
        argv,
        [module.add_parser for module in (faults, answers, fuzz, soak)],
        prog="dfvs-robustness",
        description="Disturb the service on purpose, and judge it by the safety invariants.",
        epilog=_EPILOG,
    )


if __name__ == "__main__":
    sys.exit(main())
