"""``dfvs-camera``: publish a camera, calibrate it, take goal images with it."""

import sys
from collections.abc import Callable, Sequence

from dfvs_common.lifecycle import run_command


def _publish(words: Sequence[str]) -> int:
    from dfvs_service.camera.publish import run

    return run(words)


def _board(words: Sequence[str]) -> int:
    from dfvs_service.camera.calibration.command import run_board

    return run_board(words)


def _calibrate(words: Sequence[str]) -> int:
    from dfvs_service.camera.calibration.command import run

    return run(words)


def _goal(words: Sequence[str]) -> int:
    from dfvs_service.camera.goal import run

    return run(words)


_COMMANDS: dict[str, Callable[[Sequence[str]], int]] = {
    "board": _board,
    "calibrate": _calibrate,
    "goal": _goal,
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; 0 when it worked, 2 when it cannot run, with one line that says why."""
    from dfvs_service.camera.options import quiet_libraries

    quiet_libraries()
    words = list(sys.argv[1:] if argv is None else argv)
    command = _COMMANDS.get(words[0]) if words else None
    return run_command(lambda: _publish(words) if command is None else command(words[1:]))


if __name__ == "__main__":
    sys.exit(main())
