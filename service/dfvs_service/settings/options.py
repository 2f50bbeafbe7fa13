"""Settings options of the service's command lines."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dfvs_service.settings.config import ServiceConfig, load_config, parse_assignment


def add_settings_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--config``, ``--vehicle`` and ``--set``."""
    parser.add_argument("--config", type=Path, metavar="FILE", help="settings in TOML")
    parser.add_argument("--vehicle", metavar="NAME", help="name of the vehicle (vehicle.name)")
    parser.add_argument(
        "--set",
        dest="assignments",
        action="append",
        default=[],
        metavar="SECTION.KEY=VALUE",
        help="any other setting; may be repeated (see: dfvs-service config)",
    )


def settings_from(
    arguments: argparse.Namespace, shortcuts: Mapping[str, Any] | None = None
) -> ServiceConfig:
    """Settings of a file, under those of ``--set``, under those that have their own option.

    ``arguments`` have the options of :func:`add_settings_options`. ``shortcuts`` map
    ``section.key`` to the value of its own option, None where it was not given.

    Raises
    ------
    ConfigError
        If the file cannot be read, or a key or value is wrong.
    """
    overrides = dict(parse_assignment(text) for text in arguments.assignments)
    named = {"vehicle.name": arguments.vehicle, **(shortcuts or {})}
    overrides.update({key: value for key, value in named.items() if value is not None})
    return load_config(arguments.config, overrides)
