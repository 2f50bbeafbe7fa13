"""``dfvs-camera``: publish a camera, calibrate it, take goal images with it."""

import sys
from collections.abc import Sequence

from dfvs_common.command_line import require_options
from dfvs_common.lifecycle import run_command


def _run(words: Sequence[str]) -> int:
    """Run the command that the first word names, or else publish; each loads what it needs."""
    match words:
        case ["board", *options]:
            from dfvs_service.camera.calibration.command import run_board

            return run_board(options)
        case ["calibrate", *options]:
            from dfvs_service.camera.calibration.command import run as calibrate

            return calibrate(options)
        case ["goal", *options]:
            from dfvs_service.camera.goal import run as take_goal

            return take_goal(options)
    require_options(words, ("board", "calibrate", "goal"))
    from dfvs_service.camera.publish import run as publish

    return publish(words)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; 0 when it worked, 2 when it cannot run, with one line that says why."""
    from dfvs_service.camera.options import quiet_libraries

    quiet_libraries()
    words = list(sys.argv[1:] if argv is None else argv)
    return run_command(lambda: _run(words))


if __name__ == "__main__":
    sys.exit(main())
