"""``dfvs-report``: a flight's page and video, from its black box or its recording."""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dfvs_common.atomic_file import replace_file
from dfvs_common.command_line import program_parser, require_replaceable
from dfvs_common.lifecycle import EXIT_OK, give_way_to_flights, run_command
from dfvs_common.progress import StatusLine
from dfvs_core.errors import ConfigError
from dfvs_core.gate.config import S
from dfvs_service.flights.store import FlightStore, flights_folder
from dfvs_service.page.page import require_page_extra
from dfvs_service.report.source import MCAP, open_flight
from dfvs_service.settings.options import add_settings_options, settings_from
from dfvs_service.supervisor.child import use_one_blas_thread

if TYPE_CHECKING:
    from dfvs_service.report.flight import Flight, FlightSource

_SHOW_S = 0.5

_EXAMPLE = """\
examples:
  dfvs-report latest
  dfvs-report 20260102T101112Z-drone1 --out flight.html
  dfvs-report /media/stick/20260102T101112Z-drone1
  dfvs-report flights/drone1-20260102T101112Z-*.mcap

The names of flights are listed by: dfvs-service flights
exit code: 0 written, 2 cannot run
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    arguments = _parser().parse_args(argv)
    if argv is None:
        use_one_blas_thread("dfvs_service.report.cli")
        give_way_to_flights()
    return run_command(lambda: _write(arguments))


def _parser() -> argparse.ArgumentParser:
    parser = program_parser(
        "dfvs-report",
        "Make HTML page and film (VP8 in WebM) of a flight: verdict, views, path, states, "
        "distances, velocities, timing, faults and settings. The page needs nothing else.",
        _EXAMPLE,
    )
    add = parser.add_argument
    add(
        "flight",
        nargs="+",
        metavar="FLIGHT",
        help="a flight's folder or name, 'latest', or the files of a recording (MCAP)",
    )
    add("--out", type=Path, metavar="FILE", help="page, replaced if it exists (default: NAME.html)")
    add(
        "--film",
        type=Path,
        metavar="FILE",
        help="video, replaced if it exists (default: the page's name, but .webm)",
    )
    add(
        "--truth",
        type=Path,
        metavar="FILE",
        help="true errors of a simulated flight: JSON lines with t_ns, error_m and error_rad",
    )
    add(
        "--engagement",
        type=int,
        metavar="N",
        help="engagement that is shown where there are several, from 1 (default: the last one)",
    )
    add("--json", action="store_true", help="print the result as JSON")
    add_settings_options(parser)
    return parser


def _write(arguments: argparse.Namespace) -> int:
    require_page_extra("dfvs-report")
    source = _source(arguments)
    page = arguments.out or Path(f"{source.name}.html")
    require_replaceable("--out", page, ".html")
    video = arguments.film or page.with_suffix(".webm")
    require_replaceable("--film", video, ".webm")
    # Jinja2 and OpenCV take their time to load.
    from dfvs_service.report.flight_page import make_report

    flight = source.read()
    count = len(flight.engagements)
    if arguments.engagement not in (None, *range(1, count + 1)):
        raise ConfigError(
            f"--engagement {arguments.engagement}; the flight has {count}", f"one from 1 to {count}"
        )
    flight = dataclasses.replace(flight, shown=arguments.engagement or 0)
    if arguments.truth is not None:
        add_truth(flight, arguments.truth)
    progress = StatusLine(interval_s=_SHOW_S)
    of = f"of {flight.line.to_s:.0f} s"
    text = make_report(
        source, flight, video, lambda view: progress.show(f"film: {view.t_s:.0f} {of}")
    )
    progress.clear()
    replace_file(page, text.encode())
    written = [path for path in (page, video) if path.exists()]
    if arguments.json:
        files = [str(path) for path in written]
        print(json.dumps({"name": source.name, "verdict": flight.summary.verdict, "files": files}))
    else:
        print(f"{flight.summary.verdict}\nwrote {' and '.join(map(str, written))}")
    return EXIT_OK


def add_truth(flight: Flight, path: Path) -> None:
    """Put the true distance and angle to the goal beside the estimated ones.

    ``path`` holds JSON lines with ``t_ns`` (monotonic), ``error_m`` and ``error_rad``.

    Raises
    ------
    ConfigError
        If the file cannot be read or holds something else.
    """
    try:
        for line in path.read_text(encoding="utf-8").splitlines():
            record = json.loads(line)
            t_s = (int(record["t_ns"]) - flight.start_ns) / S
            flight.series.true_m.append((t_s, float(record["error_m"])))
            flight.series.true_deg.append((t_s, math.degrees(float(record["error_rad"]))))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ConfigError(
            f"the true errors cannot be read from {path} ({error!r})",
            "JSON lines with t_ns, error_m and error_rad",
        ) from error


def _source(arguments: argparse.Namespace) -> FlightSource:
    """Records of the flight that was named."""
    paths = [Path(word) for word in arguments.flight]
    word = arguments.flight[0]
    is_here = word != "latest" and paths[0].is_dir()
    if len(paths) == 1 and paths[0].suffix != MCAP and paths[0].name == word and not is_here:
        flights = flights_folder(settings_from(arguments).black_box, os.environ)
        paths = [FlightStore(flights).folder(word)]
    return open_flight(*paths)


if __name__ == "__main__":
    sys.exit(main())
