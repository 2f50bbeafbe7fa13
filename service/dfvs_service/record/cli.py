"""``dfvs-record``: record a running service's flight as MCAP, or repair a recording."""

import argparse
import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from dfvs_common.command_line import program_parser
from dfvs_common.lifecycle import (
    EXIT_FAILED,
    EXIT_OK,
    give_way_to_flights,
    handle_ending_signals,
    run_command,
)
from dfvs_common.progress import StatusLine, log, warn
from dfvs_service.record.preparation import prepare_folder, require_record_extra
from dfvs_service.settings.options import add_settings_options, settings_from

_EXAMPLE = """\
example, beside a running dfvs-service:
  dfvs-record --out flights
  dfvs-record --out flights --vehicle drone2 --set zenoh.listen='["tcp/127.0.0.1:7448"]'

after a crash:
  dfvs-record recover flights/drone1-20260102T101112Z-000.mcap

To record a flight from its first frame on, start the service with --record DIR instead.
exit code: 0 recorded, 1 nothing came, 2 cannot run
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    words = list(sys.argv[1:] if argv is None else argv)
    if argv is None:
        give_way_to_flights()
    is_recovery = words[:1] == ["recover"]
    return run_command(lambda: _recover(words[1:]) if is_recovery else _record(words))


def _record(words: Sequence[str]) -> int:
    parser = program_parser(
        "dfvs-record",
        "Record what a running dfvs-service sees, decides and sends, as MCAP files "
        "that Foxglove opens and dfvs-replay reruns. Ends with Ctrl-C.",
        _EXAMPLE,
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="where files go")
    parser.add_argument("--json", action="store_true", help="print what was recorded as JSON")
    add_settings_options(parser)
    arguments = parser.parse_args(words)
    config = settings_from(arguments)
    # Zenoh, MCAP and protobuf are needed from here on, and take their time to load.
    require_record_extra()
    from dfvs_service.record.follow import Follower
    from dfvs_service.record.process import progress_text, record

    folder = prepare_folder(arguments.out)
    follower = Follower(config)
    handle_ending_signals(follower.stop)
    log(f"recording {config.vehicle.name} in {folder}")
    line = StatusLine()
    summary = record(config, folder, follower, lambda state: line.show(progress_text(state)))
    line.end()
    counts = summary.counts
    if arguments.json:
        print(json.dumps(dataclasses.asdict(summary)))
    else:
        print(
            f"{counts.records} records, {summary.size_bytes / 1e6:.1f} MB in {summary.folder}/"
            f"{summary.name}-*.mcap; {counts.missing} missing, {counts.dropped} dropped"
        )
    return EXIT_OK if counts.records else EXIT_FAILED


def _recover(words: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="dfvs-record recover",
        description="Give a recording that was cut short its index, so that every tool opens it.",
        epilog="example: dfvs-record recover flights/drone1-20260102T101112Z-000.mcap",
    )
    parser.add_argument("file", type=Path, metavar="FILE")
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="repaired file (default: FILE's name + -recovered)"
    )
    arguments = parser.parse_args(words)
    require_record_extra()
    from dfvs_service.record.reading import recover

    source: Path = arguments.file
    target = arguments.out or source.with_name(f"{source.stem}-recovered.mcap")
    count = recover(source, target, warn)
    print(f"{count} messages in {target}")
    return EXIT_OK if count else EXIT_FAILED


if __name__ == "__main__":
    sys.exit(main())
