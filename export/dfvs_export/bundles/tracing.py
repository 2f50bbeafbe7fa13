"""Tracing of networks to ONNX files, and rounding of their weights, which compress better then."""

import io
import warnings

import numpy as np
import onnx
import torch
from onnx import TensorProto, numpy_helper
from torch import Tensor, nn

from dfvs_core.errors import ModelError

OPSET = 17
_SIGNIFICANT_BITS = 17
"""Of 24; the others are zeros (docs/experiments/networks.md, rounded weights)."""
TensorNames = tuple[tuple[str, ...], tuple[str, ...]]
"""Names of a graph's inputs and outputs."""


def trace(
    graph: nn.Module,
    inputs: tuple[Tensor, ...],
    names: TensorNames,
    free_axes: dict[str, dict[int, str]] | None = None,
) -> bytes:
    """Trace a graph with these inputs.

    ``free_axes`` names the axes, by tensor, whose size is not fixed.
    """
    file = io.BytesIO()
    with warnings.catch_warnings(), torch.no_grad():
        # the tracing exporter is the one whose files were measured to be small and fast here
        warnings.simplefilter("ignore")
        torch.onnx.export(
            graph,
            inputs,
            file,  # type: ignore[arg-type]  # the tracing exporter writes to files of any kind
            input_names=list(names[0]),
            output_names=list(names[1]),
            opset_version=OPSET,
            dynamic_axes=free_axes,
            dynamo=False,
        )
    return file.getvalue()


def trace_published(
    name: str, graph: nn.Module, inputs: tuple[Tensor, ...], names: TensorNames
) -> bytes:
    """Trace a network that may use operators that ONNX lacks.

    Raises
    ------
    ModelError
        If torch cannot export the network ``name``.
    """
    try:
        return trace(graph, inputs, names)
    except RuntimeError as error:
        reason = str(error).splitlines()[0]
        raise ModelError(
            f"{name} cannot be exported: {reason}", "operators that ONNX has"
        ) from error


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
