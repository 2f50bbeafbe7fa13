"""``dfvs-export train``, ``train-depth`` and ``train-pose``: their options."""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import TypeAlias

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"
"""What subcommands are added to."""


def add_train(commands: Commands) -> None:
    """Add ``train``."""
    train = commands.add_parser(
        "train",
        help="train dfvs-flow on pairs of dfvs-rooms",
        description="Train the matcher of dfvs-flow, and with --encoder-blocks the last blocks of"
        " its encoder, on wide-baseline pairs (dfvs-rooms pairs --format wide). Writes a checkpoint"
        " every few minutes.",
    )
    start = "checkpoint or published wheel (default: the shipped weights)"
    _add_training(train, 2e-4, start)
    add = train.add_argument
    add("--encoder-blocks", type=int, default=0, choices=range(5), metavar="0..4")
    add("--keypoints", type=int, default=1024, metavar="N", help="of a view (default 1024)")
    train.set_defaults(run=_training("flow", "train", "FlowTrainSettings"))


def add_train_depth(commands: Commands) -> None:
    """Add ``train-depth``."""
    train = commands.add_parser(
        "train-depth",
        help="train dfvs-depth on views of dfvs-rooms",
        description="Train dfvs-depth on the views of wide-baseline pairs "
        "(dfvs-rooms pairs --format wide). Writes a checkpoint every few minutes.",
    )
    start = "checkpoint, or the wheel of ImageNet's encoder"
    _add_training(train, 5e-4, start, needs_start=True)
    blocks = range(17)
    train.add_argument("--frozen-blocks", type=int, default=3, choices=blocks, metavar="0..16")
    train.set_defaults(run=_training("depth", "train_depth", "DepthTrainSettings"))


def add_train_pose(commands: Commands) -> None:
    """Add ``train-pose``."""
    train = commands.add_parser(
        "train-pose",
        help="train a network that regresses the pose between two images",
        description="Train a baseline of the benchmark: after Saxena et al. on wide-baseline pairs"
        " (dfvs-rooms pairs --format wide) and near ones made of them by depth, or after Bateux et"
        " al. on homographies of their views. Writes a checkpoint every few minutes.",
    )
    train.add_argument("--network", choices=("saxena", "bateux"), required=True)
    start = "checkpoint to go on from; of bateux, else the wheel of ImageNet's encoder"
    _add_training(train, 5e-4, start)
    train.set_defaults(run=_training("pose", "train_pose", "PoseTrainSettings"))


def _add_training(
    command: argparse.ArgumentParser, learning_rate: float, start: str, needs_start: bool = False
) -> None:
    """Add pairs, checkpoint, time, rate, seed, threads, and the weights to start from."""
    add = command.add_argument
    add("--pairs", type=Path, required=True, metavar="DIR", help="folder of wide-baseline pairs")
    add("--out", type=Path, required=True, metavar="FILE.pt", help="checkpoint to write")
    add("--minutes", type=float, default=60.0)
    add("--learning-rate", type=float, default=learning_rate)
    add("--seed", type=int, default=0, help="of all draws; another one to go on from a checkpoint")
    add("--threads", type=int, default=2)
    add("--from", dest="start", type=Path, required=needs_start, metavar="FILE", help=start)


def _training(module: str, name: str, settings: str) -> Callable[[argparse.Namespace], int]:
    """Function ``name`` of a module of trainings; its settings come from options of their names."""

    def run(arguments: argparse.Namespace) -> int:
        found = importlib.import_module(f"dfvs_export.training.{module}")
        kind = getattr(found, settings)
        getattr(found, name)(kind(**{f.name: getattr(arguments, f.name) for f in fields(kind)}))
        print(f"wrote {arguments.out}")
        return 0

    return run
