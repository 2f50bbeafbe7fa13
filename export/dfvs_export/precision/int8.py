"""Heavy operators in 8 bits: static, per channel, calibrated on frames."""

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

from dfvs_export.precision.heavy_nodes import carrying_nodes, heavy_nodes

Feeds = dict[str, NDArray[np.float32]]


class _Frames(CalibrationDataReader):  # type: ignore[misc]
    """Feeds for the calibration, one after the other."""

    def __init__(self, feeds: Sequence[Feeds]) -> None:
        self._feeds: Iterator[Feeds] = iter(feeds)

    def get_next(self) -> Feeds | None:
        """Return the next one, or None after the last."""
        return next(self._feeds, None)


def to_int8(data: bytes, takes_images: bool, feeds: Sequence[Feeds]) -> bytes:
    """ONNX file, of one in float32, with its heavy nodes in 8 bits.

    For ``takes_images`` see :func:`heavy_nodes`; ``feeds`` are inputs that show which range every
    tensor takes.
    """
    with tempfile.TemporaryDirectory() as folder:
        plain, ready, done = (Path(folder) / f"{name}.onnx" for name in ("plain", "ready", "done"))
        plain.write_bytes(data)
        # folds away batch normalisation and the like, before nodes are chosen
        quant_pre_process(str(plain), str(ready), skip_symbolic_shape=True)
        graph = onnx.load_model(str(ready)).graph
        heavy = heavy_nodes(graph, takes_images)
        chosen = [node.name for node in (*heavy, *carrying_nodes(graph, heavy))]
        quantize_static(
            str(ready),
            str(done),
            _Frames(feeds),
            quant_format=QuantFormat.QDQ,
            nodes_to_quantize=chosen,
            op_types_to_quantize=["Conv", "Gemm", "MatMul", "Add", "Concat", "Relu"],
            per_channel=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            calibrate_method=CalibrationMethod.MinMax,
        )
        return done.read_bytes()
