"""Options that name another autopilot in place of the simulated vehicle."""

import argparse
from typing import Any

from dfvs_core.errors import ConfigError
from dfvs_sim.options import require_range


def add_autopilot_options(parser: Any) -> None:
    """Add ``--autopilot``, ``--ground`` and ``--system-id``."""
    add = parser.add_argument
    add("--autopilot", metavar="URL", help="MAVLink of a running simulated PX4; it is armed")
    add("--ground", metavar="URL", help="its ground-station link (default udpin on 14550)")
    add(
        "--system-id",
        type=int,
        metavar="N",
        help="MAVLink system id (default: 1, or that of the vehicle on --autopilot's link)",
    )


def check_autopilot(args: argparse.Namespace) -> None:
    """Refuse these options, and those that only the simulated vehicle has, if they do not agree."""
    if args.system_id is not None:
        require_range(args, 1, 250, "system_id")
    if args.ground is not None and args.autopilot is None:
        raise ConfigError("--ground without --autopilot", "the links of a running autopilot")
    for name in ("autopilot", "ground"):
        url = getattr(args, name)
        if url is not None and "://" not in url:
            raise ConfigError(f"--{name} is {url!r}", "a MAVLink URL such as udpin://HOST:PORT")
    for name in ("estimate", "wind"):
        if args.autopilot is not None and getattr(args, name) is not None:
            raise ConfigError(f"--{name} beside --autopilot", "only one of them")
