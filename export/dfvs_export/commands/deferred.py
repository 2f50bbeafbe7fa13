"""Subcommands that are imported when they run: most need torch, which takes seconds to import."""

import argparse
import functools
import importlib
from collections.abc import Callable
from dataclasses import fields


def deferred(module: str, name: str) -> Callable[[argparse.Namespace], int]:
    """Function ``name`` of a module of this package; it takes the arguments."""

    def run(arguments: argparse.Namespace) -> int:
        found = importlib.import_module(f"dfvs_export.commands.{module}")
        return int(getattr(found, name)(arguments))

    return run


def training(module: str, name: str, settings: str) -> Callable[[argparse.Namespace], int]:
    """Function ``name`` of a module of trainings; its settings come from options of their names."""

    def run(arguments: argparse.Namespace) -> int:
        found = importlib.import_module(f"dfvs_export.training.{module}")
        kind = getattr(found, settings)
        given = {field.name: getattr(arguments, field.name) for field in fields(kind)}
        getattr(found, name)(kind(**given), functools.partial(print, flush=True))
        print(f"wrote {arguments.out}")
        return 0

    return run
