"""``dfvs-sim`` without a command: vehicle and camera together."""

import argparse
import contextlib
import time

from dfvs_common.child import Child
from dfvs_sim.ground.sharing import DEFAULT_PORT

_POLL_S = 0.2


def add_options(parser: argparse.ArgumentParser) -> None:
    """Make this what ``dfvs-sim`` does when no command is named."""
    parser.set_defaults(run=run)


def run(_args: argparse.Namespace) -> int:
    """Run the vehicle and the camera with their defaults until told to stop or one ends.

    The camera shares its ground-station link with ``dfvs-sim pilot``.
    """
    words = (["vehicle"], ["camera", "--share", str(DEFAULT_PORT)])
    children = [Child(name, ["dfvs_sim.cli", name, *more]) for name, *more in words]
    with contextlib.ExitStack() as stack:
        for child in children:
            stack.enter_context(child)
        while all(child.exit_code is None for child in children):
            time.sleep(_POLL_S)
    return max((child.exit_code or 0 for child in children), default=0)
