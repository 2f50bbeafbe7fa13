"""Command lines of several commands: parsing, output paths, exit codes, one-line errors."""

import argparse
import math
import os
from collections.abc import Iterable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from dfvs_common import lifecycle
from dfvs_core.errors import ConfigError


class _Parser(argparse.ArgumentParser):
    """Parser, also of subcommands, whose texts keep their lines where it has an epilog."""

    def __init__(self, **options: Any) -> None:
        if options.get("epilog"):
            options["formatter_class"] = argparse.RawDescriptionHelpFormatter
        super().__init__(**options)


def command_parser(prog: str, description: str, epilog: str) -> argparse.ArgumentParser:
    """Parser of a program's command, whose texts keep their lines."""
    return _Parser(prog=prog, description=description, epilog=epilog)


def program_parser(prog: str, description: str, epilog: str) -> argparse.ArgumentParser:
    """Parser of a program, whose texts keep their lines; ``--version`` prints and ends."""
    parser = command_parser(prog, description, epilog)
    parser.add_argument(
        "--version",
        action="version",
        version=f"{prog} {version('dfvs')}",
        help="print the version and exit",
    )
    return parser


def require_options(words: Sequence[str], commands: Iterable[str]) -> None:
    """Refuse a first word that is no option, and none of a program's commands.

    Raises
    ------
    ConfigError
        Naming the commands.
    """
    if words and not words[0].startswith("-"):
        raise ConfigError(
            f"there is no command {words[0]!r}", f"options, or one of {', '.join(commands)}"
        )


def parse_size(text: str, option: str = "--size") -> tuple[int, int]:
    """(width, height) in px of an image, from ``"320x240"``.

    Raises
    ------
    ConfigError
        If the text is no size.
    """
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise ConfigError(f"{option} is {text!r}", "WIDTHxHEIGHT such as 320x240")
    return int(width), int(height)


def require_range(args: object, low: float, high: float | None, *names: str) -> None:
    """Refuse options, attributes of ``args``, that are below ``low`` or above ``high``.

    Without a ``high`` there is no upper bound. An option that is None was not given.

    Raises
    ------
    ConfigError
        Naming the option.
    """
    for name in names:
        value = getattr(args, name)
        if value is not None and not low <= value <= (math.inf if high is None else high):
            above = "or more" if high is None else f"to {_plain(high)}"
            raise ConfigError(
                f"--{name.replace('_', '-')} is {_plain(value)}", f"{_plain(low)} {above}"
            )


def _plain(number: float) -> str:
    return f"{number:g}" if isinstance(number, float) else str(number)


def require_folder(option: str, path: Path | None) -> None:
    """Refuse what an option names in a folder that does not exist; None is nothing.

    Raises
    ------
    ConfigError
        If it does not.
    """
    if path is not None and not path.absolute().parent.is_dir():
        raise ConfigError(f"{option} {path} lies in no folder", "an existing folder")


def require_file(option: str, path: Path | None, ending: str = "") -> None:
    """Refuse a file to write that lies in no folder, is one, or is named otherwise.

    Parameters
    ----------
    option : str
        Option that names it, for the error.
    path : Path, optional
        None is no file.
    ending : str
        Ending that its name must have, in either case; empty for any.

    Raises
    ------
    ConfigError
        If it cannot be written.
    """
    require_folder(option, path)
    if path is not None and path.is_dir():
        raise ConfigError(f"{option} {path} is a folder", "a file in it")
    if path is not None and ending and path.suffix.lower() != ending:
        raise ConfigError(f"{option} is {str(path)!r}", f"a name that ends in {ending}")


def require_replaceable(option: str, path: Path | None, ending: str = "") -> None:
    """Refuse a file that :func:`require_file` refuses, or whose folder takes no new files.

    Raises
    ------
    ConfigError
        If it cannot be written.
    """
    require_file(option, path, ending)
    if path is not None and not os.access(path.absolute().parent, os.W_OK):
        raise ConfigError(f"{option} {path} cannot be written", "a folder that is writable")


def run_subcommand(parser: argparse.ArgumentParser, argv: Sequence[str] | None) -> int:
    """Parse, call the chosen command's ``run(args)``, and turn errors into exit codes.

    Every ``run`` gives an exit code, and raises a ``DfvsError`` where an option, a file that it
    names, or what is asked for cannot be used.
    """
    args = parser.parse_args(argv)
    return lifecycle.run_command(lambda: int(args.run(args)))
