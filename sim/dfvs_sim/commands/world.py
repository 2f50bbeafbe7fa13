"""``dfvs-sim`` without a command: vehicle and camera together."""

import argparse
import contextlib
import sys
import time
from collections.abc import Mapping

from dfvs_common.child import Child, describe_end
from dfvs_common.lifecycle import EXIT_FAILED, EXIT_OK
from dfvs_sim.ground.sharing import DEFAULT_PORT

_POLL_S = 0.2


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
        # How the others end, which are ended from here, is not judged.
        codes = {child.name: child.exit_code for child in children}
    return _exit_code({name: code for name, code in codes.items() if code is not None})


def _exit_code(codes: Mapping[str, int]) -> int:
    """Exit code by those of the processes that ended by themselves; says which one crashed."""
    crashed = {name: code for name, code in codes.items() if code < 0}
    for name, code in crashed.items():
        print(f"error: the {name} {describe_end(code)}", file=sys.stderr, flush=True)
    return EXIT_FAILED if crashed else max(codes.values(), default=EXIT_OK)
