"""Options that all trainings of ``dfvs-export`` share."""

from __future__ import annotations

import argparse
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    _Settings = TypeVar("_Settings", bound=DataclassInstance)


def add_training(command: argparse.ArgumentParser, learning_rate: float) -> None:
    """Add pairs, checkpoint, time, rate, seed and threads."""
    add = command.add_argument
    add("--pairs", type=Path, required=True, metavar="DIR", help="folder of wide-baseline pairs")
    add("--out", type=Path, required=True, metavar="FILE.pt", help="checkpoint to write")
    add("--minutes", type=float, default=60.0)
    add("--learning-rate", type=float, default=learning_rate)
    add("--seed", type=int, default=0)
    add("--threads", type=int, default=2)


def settings_from(kind: type[_Settings], arguments: argparse.Namespace) -> _Settings:
    """Settings of a training, each from the option of its name."""
    return kind(**{f.name: getattr(arguments, f.name) for f in fields(kind)})


def say_line(line: str) -> None:
    """Print a line of progress at once."""
    print(line, flush=True)
