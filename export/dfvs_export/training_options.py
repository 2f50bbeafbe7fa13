"""Options that all trainings of ``dfvs-export`` share."""

from __future__ import annotations

import argparse
from pathlib import Path


def add_training(command: argparse.ArgumentParser, learning_rate: float) -> None:
    """Add pairs, checkpoint, time, rate, seed and threads."""
    add = command.add_argument
    add("--pairs", type=Path, required=True, metavar="DIR", help="folder of wide-baseline pairs")
    add("--out", type=Path, required=True, metavar="FILE.pt", help="checkpoint to write")
    add("--minutes", type=float, default=60.0)
    add("--learning-rate", type=float, default=learning_rate)
    add("--seed", type=int, default=0)
    add("--threads", type=int, default=2)
