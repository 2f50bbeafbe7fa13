"""``dfvs-certs``: certificates for Zenoh beyond one machine."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from dfvs_common.command_line import program_parser
from dfvs_common.extras import require_package
from dfvs_common.lifecycle import EXIT_OK, run_command
from dfvs_core.errors import ConfigError

_EPILOG = """\
example:
  dfvs-certs --out certificates --vehicle drone1 --host 192.168.1.10

Give each machine the folders of its own roles and no other. The folder authority belongs on no
aircraft: whoever has its key can make certificates for any role. Run again, it keeps what is there
and adds what is missing. Exit code: 0 made, 2 cannot run.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Make the files; one line on standard error where that cannot be."""
    arguments = _parser().parse_args(argv)
    return run_command(lambda: _make(arguments))


def _make(arguments: argparse.Namespace) -> int:
    require_package("dfvs-certs needs", "cryptography", "deploy")
    from dfvs_service.certificates.roles import make_everything

    try:
        make_everything(arguments)
    except OSError as error:
        raise ConfigError(
            f"{arguments.out} cannot be written ({error.strerror})", "a writable folder"
        ) from error
    return EXIT_OK


def _parser() -> argparse.ArgumentParser:
    parser = program_parser(
        "dfvs-certs",
        "Make an authority, a certificate for each role, and a router's configuration "
        "for Zenoh, by which every role may do its own work and nothing else.",
        _EPILOG,
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="where to")
    parser.add_argument(
        "--vehicle",
        action="append",
        default=[],
        metavar="NAME",
        help="may be repeated (default: drone1)",
    )
    parser.add_argument(
        "--host",
        action="append",
        default=[],
        metavar="NAME",
        help="name or address at which router or service is reached, beside localhost and "
        "127.0.0.1; may be repeated",
    )
    parser.add_argument("--days", type=int, default=365, help="validity (default: 365)")
    parser.add_argument(
        "--listen",
        metavar="ENDPOINT",
        help="where the router listens (default: as its file says, or tls/0.0.0.0:7447)",
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
