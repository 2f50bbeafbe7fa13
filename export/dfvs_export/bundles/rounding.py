"""Rounding of weights to fewer significant bits, so that the file compresses better."""

import numpy as np
import onnx
from onnx import TensorProto, numpy_helper

_SIGNIFICANT_BITS = 17
"""Of 24; the others are zeros (docs/experiments/networks.md, rounded weights)."""


def round_weights(data: bytes) -> bytes:
    """ONNX file of the graph with its float32 weights rounded to 17 significant bits."""
    model = onnx.load_from_string(data)
    for tensor in model.graph.initializer:
        if tensor.data_type == TensorProto.FLOAT:
            mantissa, exponent = np.frexp(numpy_helper.to_array(tensor))
            whole = np.rint(np.ldexp(mantissa, _SIGNIFICANT_BITS))
            rounded = np.ldexp(whole, exponent - _SIGNIFICANT_BITS)
            tensor.CopyFrom(numpy_helper.from_array(rounded, tensor.name))
    return bytes(model.SerializeToString())
