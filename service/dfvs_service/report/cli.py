"""``dfvs-report``: a flight's page, from the records of the black box."""

from __future__ import annotations

import argparse
import importlib.util
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from dfvs_core.errors import ConfigError
from dfvs_core.lifecycle import run_command
from dfvs_service.atomic_file import write_atomic
from dfvs_service.flights.store import FlightStore, flights_folder
from dfvs_service.settings_options import add_settings_options, settings_from

EXIT_OK = 0

_EXAMPLE = """\
example:
  dfvs-report latest
  dfvs-report 20260102T101112Z-drone1 --out flight.html
  dfvs-report /media/stick/20260102T101112Z-drone1

The names of flights are listed by: dfvs-service flights
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="dfvs-report",
        description="Make an HTML page about a flight: verdict, views, path, states, distances, "
        "velocities, timing and settings. The page needs nothing else.",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("flight", metavar="FLIGHT", help="name, 'latest', or a flight's folder")
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="page, replaced if it exists (default: NAME.html)"
    )
    add_settings_options(parser)
    arguments = parser.parse_args(argv)
    return run_command(lambda: _write(arguments))


def _write(arguments: argparse.Namespace) -> int:
    if importlib.util.find_spec("jinja2") is None:
        raise ConfigError(
            "dfvs-report needs the Python package 'jinja2'",
            "the extra 'report'",
            "pip install 'dfvs[report]'",
        )
    folder = _folder(arguments)
    # Jinja2 and OpenCV take their time to load.
    from dfvs_service.report.page import flight_page

    target = arguments.out or Path(f"{folder.name}.html")
    try:
        write_atomic(target, flight_page(folder).encode())
    except OSError as error:
        raise ConfigError(
            f"{target} cannot be written ({error.strerror})", "a folder that exists and is writable"
        ) from error
    print(f"wrote {target}")
    return EXIT_OK


def _folder(arguments: argparse.Namespace) -> Path:
    """Folder of the flight, which is named by its path or by its name."""
    path = Path(arguments.flight)
    if path.name != arguments.flight:
        if not path.is_dir():
            raise ConfigError(f"there is no folder {path}", "the folder of a flight")
        return path.resolve()
    return FlightStore(flights_folder(settings_from(arguments).black_box, os.environ)).folder(
        arguments.flight
    )


if __name__ == "__main__":
    sys.exit(main())
