"""Static 8-bit quantisation of a bundle's convolutions, per channel, calibrated on frames."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import onnx
from numpy.typing import NDArray
from onnxruntime.quantization import (
    CalibrationDataReader,
    CalibrationMethod,
    QuantFormat,
    QuantType,
    quantize_static,
)
from onnxruntime.quantization.shape_inference import quant_pre_process

from dfvs_export.check import ImagePair
from dfvs_export.onnx_pair import ENCODE_INPUTS, OnnxPair
from dfvs_export.running import FlowRunner

_KEPT_FLOAT = re.compile(r"/(flow|judge|mask|stem)(\.\d+|_\d+)*/|/update\d(_\d+)?/Conv")
"""Convolutions that stay as they are: the last ones, the first, and the sums of the look-ups'
softmax, whose terms span dozens of orders of magnitude."""

Feeds = dict[str, NDArray[np.float32]]


class _Frames(CalibrationDataReader):  # type: ignore[misc]
    """Feeds for the calibration, one after the other."""

    def __init__(self, feeds: Sequence[Feeds]) -> None:
        self._feeds: Iterator[Feeds] = iter(feeds)

    def get_next(self) -> Feeds | None:
        """Return the next one, or None after the last."""
        return next(self._feeds, None)


def quantise(onnx_pair: OnnxPair, runner: FlowRunner, pairs: Sequence[ImagePair]) -> OnnxPair:
    """Quantise both graphs; ``runner`` runs the same network in floating point."""
    encode_feeds: list[Feeds] = []
    match_feeds: list[Feeds] = []
    for first, second in pairs:
        tensors = [runner.tensor(first), runner.tensor(second)]
        encode_feeds += [{ENCODE_INPUTS[0]: t} for t in tensors]
        features = runner.encode(first), runner.encode(second)
        match_feeds.append(runner.manifest.match_feeds(*features))
    return OnnxPair(
        _quantise(onnx_pair.encode, encode_feeds), _quantise(onnx_pair.match, match_feeds)
    )


def _quantise(data: bytes, feeds: Sequence[Feeds]) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        plain, ready, done = (Path(folder) / f"{name}.onnx" for name in ("plain", "ready", "done"))
        plain.write_bytes(data)
        quant_pre_process(str(plain), str(ready), skip_symbolic_shape=True)
        nodes = onnx.load_model(str(ready)).graph.node
        kept = [n.name for n in nodes if _KEPT_FLOAT.search(n.name)]
        quantize_static(
            str(ready),
            str(done),
            _Frames(feeds),
            quant_format=QuantFormat.QDQ,
            op_types_to_quantize=["Conv"],
            per_channel=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            nodes_to_exclude=kept,
            calibrate_method=CalibrationMethod.MinMax,
        )
        return done.read_bytes()
