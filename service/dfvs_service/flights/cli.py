"""``dfvs-service flights``: list, show and export what flights left behind."""

import argparse
import contextlib
import dataclasses
import json
import os
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

from dfvs_common.command_line import command_parser
from dfvs_common.lifecycle import EXIT_OK
from dfvs_core.errors import ConfigError
from dfvs_service.flights import layout
from dfvs_service.flights.records import FlightSummary, read_summary
from dfvs_service.flights.store import LOCK, FlightStore, flights_folder
from dfvs_service.settings.options import add_settings_options, settings_from

_EPILOG = """\
examples:
  dfvs-service flights                                     all flights, oldest first
  dfvs-service flights show latest                         what happened in the newest one
  dfvs-service flights show 20260102T101112Z-drone1 --json
  dfvs-service flights export latest flight.zip            all of its files

those of the systemd service:
  sudo -u dfvs /opt/dfvs/bin/dfvs-service flights --folder /var/lib/dfvs/flights

exit code: 0 done, 2 there is no such flight, or it cannot be read or written
"""


def flights(words: Sequence[str]) -> int:
    """Run the command; returns the exit code.

    Raises
    ------
    DfvsError
        If there is no such flight, or it cannot be read or written.
    """
    arguments = _parser().parse_args(words)
    section = settings_from(arguments).black_box
    if arguments.folder is not None:
        section = dataclasses.replace(section, folder=str(arguments.folder))
    store = FlightStore(flights_folder(section, os.environ))
    run: Callable[[FlightStore, argparse.Namespace], None] = arguments.run
    run(store, arguments)
    return EXIT_OK


def _parser() -> argparse.ArgumentParser:
    parser = command_parser(
        "dfvs-service flights",
        "List, show and export the records that every flight leaves behind.",
        _EPILOG,
    )
    common = argparse.ArgumentParser(add_help=False, argument_default=argparse.SUPPRESS)
    for each in (common, parser):
        each.add_argument("--folder", type=Path, metavar="DIR", help="flights (black_box.folder)")
        each.add_argument("--json", action="store_true", help="print the result as JSON")
    commands = parser.add_subparsers(metavar="COMMAND")
    listing = commands.add_parser("list", parents=[common], help="all flights (the default)")
    show = commands.add_parser("show", parents=[common], help="what happened in a flight")
    export = commands.add_parser("export", parents=[common], help="pack a flight as a ZIP file")
    for each, run in ((parser, _list), (listing, _list), (show, _show), (export, _export)):
        each.set_defaults(run=run)
    for each in (show, export):
        each.add_argument("name", metavar="NAME", help="name of a flight, or 'latest'")
    export.add_argument("file", type=Path, metavar="FILE.zip", help="must not exist")
    add_settings_options(parser)
    return parser


def _list(store: FlightStore, arguments: argparse.Namespace) -> None:
    summaries = [read_summary(store.path / name) for name in store.names()]
    if arguments.json:
        print(json.dumps([dataclasses.asdict(summary) for summary in summaries]))
    elif not summaries:
        print(f"no flights in {store.path}")
    else:
        print("\n".join(_table(summaries)))


def _show(store: FlightStore, arguments: argparse.Namespace) -> None:
    summary = read_summary(store.folder(arguments.name))
    if arguments.json:
        print(json.dumps(dataclasses.asdict(summary)))
    else:
        print("\n".join(_page(summary)))


def _export(store: FlightStore, arguments: argparse.Namespace) -> None:
    folder, target = store.folder(arguments.name), arguments.file
    count = export_flight(folder, target)
    size_bytes = target.stat().st_size
    if arguments.json:
        result = {"name": folder.name, "file": str(target), "files": count}
        print(json.dumps({**result, "size_bytes": size_bytes}))
    else:
        print(f"{folder.name}: {count} files, {size_bytes / 1e6:.1f} MB in {target}")


def export_flight(folder: Path, target: Path) -> int:
    """Pack all files of a flight as one ZIP file, under its name; returns how many.

    Raises
    ------
    ConfigError
        If the target exists or cannot be written, or a file cannot be read.
    """
    if target.exists():
        raise ConfigError(f"{target} exists", "a name that is free")
    partial = target.with_name(target.name + ".part")
    try:
        count = _pack(folder, partial)
        os.replace(partial, target)
    except OSError as error:
        raise ConfigError(
            f"{folder.name} cannot be exported to {target} ({error.strerror})",
            "a folder that exists and is writable",
        ) from error
    finally:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)
    return count


def _pack(folder: Path, partial: Path) -> int:
    # Listed first: the archive may lie in the folder itself.
    paths = sorted(p for p in folder.rglob("*") if p.is_file() and p.name != LOCK)
    count = 0
    # A clock that was never set gives times that ZIP cannot hold: before 1980.
    with zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED, strict_timestamps=False) as archive:
        for path in paths:
            # The oldest files of a running flight may go meanwhile.
            with contextlib.suppress(FileNotFoundError):
                archive.write(path, folder.name / path.relative_to(folder))
                count += 1
    return count


def _table(summaries: Sequence[FlightSummary]) -> list[str]:
    width = max(len(summary.name) for summary in summaries)
    lines = [f"{'flight':<{width}}  {'time':>8}  {'size':>8}  {'status':<7}  verdict"]
    for s in summaries:
        size = f"{s.size_bytes / 1e6:.1f} MB"
        lines.append(
            f"{s.name:<{width}}  {s.duration_s:6.1f} s  {size:>8}  {s.status:<7}  {s.verdict}"
        )
    return lines


def _page(summary: FlightSummary) -> list[str]:
    s = summary
    code = "" if s.exit_code is None else f", exit code {s.exit_code}"
    lines = [
        f"flight   {s.name}  ({s.size_bytes / 1e6:.1f} MB in {s.folder})",
        f"vehicle  {s.vehicle}, dfvs {s.version or 'of an unknown version'}",
        f"start    {s.started}",
        f"end      after {s.duration_s:.1f} s: {s.status}{code}",
        f"verdict  {s.verdict}",
        "",
    ]
    lines += [f"{c.t_s:9.3f} s  {c.state:<9}  {c.reason}".rstrip() for c in s.states]
    lines += ["", *s.told] if s.told else []
    inputs = Path(s.folder) / layout.GATE_INPUTS
    return [*lines, "", f"decide it again: dfvs-service replay-gate {inputs}"]
