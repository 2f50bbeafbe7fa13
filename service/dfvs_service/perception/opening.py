"""What a recording has to begin with, so that the flight can be rerun from it."""

from __future__ import annotations

import importlib.metadata
import platform
import time
from typing import Any

import cv2

from dfvs_core.goal import Goal
from dfvs_core.schema import dump
from dfvs_core.wire.turn import Opening
from dfvs_models.catalog import model_files
from dfvs_service.config import ServiceConfig

_PACKAGES = ("dfvs", "numpy", "onnxruntime")


def build_versions() -> dict[str, str]:
    """Versions of all that perception's numbers depend on."""
    packages = {name: importlib.metadata.version(name) for name in _PACKAGES}
    return {
        **packages,
        "opencv": cv2.__version__,
        "python": platform.python_version(),
        "machine": platform.machine(),
        "processor": _processor(),
    }


def make_opening(config: ServiceConfig, goal: Goal, clock: bytes, first_turn: int = 0) -> Opening:
    """Opening, as of now, of perception's work on a goal.

    Raises
    ------
    ModelError
        If the model's files cannot be read.
    """
    sidecar: dict[str, Any] = dump(goal.sidecar)
    settings: dict[str, Any] = dump(config)
    now_ns = time.monotonic_ns()
    return Opening(
        vehicle=config.vehicle.name,
        first_turn=first_turn,
        opened_ns=now_ns,
        clock=clock.hex(),
        unix_offset_ns=time.time_ns() - now_ns,
        build=build_versions(),
        model=model_files(config.flow.model),
        settings=settings,
        sidecar=sidecar,
    )


def _processor() -> str:
    """Name of the processor: its instruction set decides on the last bits of some sums."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            names = [line.partition(":")[2].strip() for line in file if line.startswith("model n")]
    except OSError:
        names = []
    return names[0] if names else platform.processor()
