"""``dfvs-replay``: run perception again on a recorded flight, and compare."""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from dfvs_common.atomic_file import replace_file
from dfvs_common.command_line import program_parser, require_replaceable
from dfvs_common.lifecycle import EXIT_FAILED, EXIT_OK, run_command
from dfvs_common.progress import StatusLine, warn
from dfvs_service.page.page import require_page_extra
from dfvs_service.record.preparation import require_record_extra
from dfvs_service.supervisor.child import use_one_blas_thread

_SHOW_S = 0.5

_EXAMPLE = """\
examples:
  dfvs-replay flights/drone1-20260102T101112Z-000.mcap
      the same commands, bit for bit, with the same build, model and settings
  dfvs-replay flights/drone1-20260102T101112Z-*.mcap --bundle my-flow --html report.html
      what another network would have commanded

exit code: 0 replayed (identical where that must be), 1 differs although nothing was changed,
2 cannot run
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    if argv is None:
        use_one_blas_thread("dfvs_service.replay.cli")
    arguments = _parser().parse_args(argv)
    return run_command(lambda: _replay(arguments))


def _parser() -> argparse.ArgumentParser:
    parser = program_parser(
        "dfvs-replay", "Run perception again on a recorded flight. Nothing is flown.", _EXAMPLE
    )
    add = parser.add_argument
    add("files", type=Path, nargs="+", metavar="FILE", help="files of one recording (MCAP)")
    add("--bundle", default="", metavar="NAME", help="another model: 'classical' or a folder")
    add("--config", type=Path, metavar="FILE", help="settings to try: [servo], [flow], [depth]")
    add("--json", type=Path, metavar="FILE", help="write the comparison there, frame by frame")
    add("--html", type=Path, metavar="FILE", help="write a report with curves there")
    return parser


def _replay(arguments: argparse.Namespace) -> int:
    require_record_extra()
    if arguments.html is not None:
        require_page_extra("--html")
    require_replaceable("--json", arguments.json)
    require_replaceable("--html", arguments.html, ".html")
    # ONNX Runtime, MCAP and protobuf take their time to load.
    from dfvs_service.replay.comparison import as_document, compare
    from dfvs_service.replay.flight import Trial, replay
    from dfvs_service.replay.reports import html_report, text_report
    from dfvs_service.settings.config import load_config

    settings = None if arguments.config is None else load_config(arguments.config, {})
    progress = StatusLine(interval_s=_SHOW_S)
    result = replay(
        arguments.files, Trial(settings, arguments.bundle), lambda n: progress.show(f"{n} frames")
    )
    progress.clear()
    for line in result.warnings:
        warn(line)
    comparison = compare(result.frames)
    text = text_report(comparison, result.reasons)
    print(text)
    if arguments.json is not None:
        document = as_document(comparison, result.reasons)
        text = json.dumps(document, indent=1, allow_nan=False) + "\n"
        replace_file(arguments.json, text.encode())
    if arguments.html is not None:
        page = html_report(comparison, result, arguments.files[0].name)
        replace_file(arguments.html, page.encode())
    must_match = not result.reasons and result.frames
    return EXIT_FAILED if must_match and not comparison.is_identical else EXIT_OK


if __name__ == "__main__":
    sys.exit(main())
