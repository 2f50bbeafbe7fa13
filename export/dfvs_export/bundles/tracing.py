"""Tracing of networks to ONNX files."""

import io
import warnings

import torch
from torch import Tensor, nn

from dfvs_core.errors import ModelError

OPSET = 17
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
