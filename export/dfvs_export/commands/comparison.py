"""Comparison of a bundle with torch, and frames to calibrate on, for all subcommands."""

import argparse

import numpy as np

from dfvs_common.progress import log
from dfvs_core.errors import ConfigError, ModelError
from dfvs_export.bundles.runner import BundleRunner, ImagePair
from dfvs_export.checks.parity import Parity, TorchNetwork, drawn_pairs, parity
from dfvs_export.precision.calibration import read_frames
from dfvs_models.bundle import Bundle

_CALIBRATION_SEED, _PARITY_SEED = 900_001, 900_002
_PARITY_PAIRS = 2
_FINITE = {"mono": "finite depth", "pose": "a finite pose"}


def compare_with_torch(network: TorchNetwork, bundle: Bundle, count: int) -> Parity:
    """Compare a bundle with its network in torch on ``count`` drawn pairs.

    Raises
    ------
    ModelError
        If either gives values that are not finite.
    """
    pairs = drawn_pairs(_size(bundle), count, _PARITY_SEED)
    found = parity(network, BundleRunner(bundle), pairs)
    if not np.isfinite(found.greatest):
        raise ModelError(
            "torch or ONNX Runtime gives values that are not finite",
            _FINITE.get(bundle.manifest.kind, "finite flow"),
        )
    return found


def agrees_with_torch(network: TorchNetwork, bundle: Bundle, unit: str = "") -> bool:
    """Compare a new bundle in fp32 with torch, and tell how far it is off in ``unit``."""
    found = compare_with_torch(network, bundle, _PARITY_PAIRS)
    log(f"greatest difference from torch: {found.greatest:.1e}{unit}")
    if not found.holds:
        print(f"not written: ONNX Runtime differs from torch by {found.greatest:.1e}{unit}")
    return found.holds


def check_calibration(arguments: argparse.Namespace) -> None:
    """Refuse options of calibration that do not fit the precision."""
    if arguments.calibration and arguments.precision != "int8":
        raise ConfigError(f"--calibration with {arguments.precision}", "it with --precision int8")
    if arguments.precision == "int8" and arguments.calibration_pairs < 1:
        raise ConfigError(f"{arguments.calibration_pairs} pairs to calibrate on", "1 or more")


def calibration_frames(arguments: argparse.Namespace, bundle: Bundle) -> list[ImagePair]:
    """Images of a bundle's size to calibrate int8 on: given ones, or else drawn patches.

    Raises
    ------
    ConfigError
        If the given ones cannot be read.
    """
    count = arguments.calibration_pairs
    if arguments.calibration:
        return read_frames(arguments.calibration, _size(bundle), count)
    return drawn_pairs(_size(bundle), count, _CALIBRATION_SEED)


def _size(bundle: Bundle) -> tuple[int, int]:
    return bundle.manifest.input.width, bundle.manifest.input.height
