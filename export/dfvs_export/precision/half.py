"""Heavy operators in half precision: weights half the size, and faster where hardware has it.

ONNX Runtime computes them in half precision on GPUs and on ARM processors that can; on x86 it
puts the casts to float32 back in, and wins nothing but the smaller file. Everything else, flow
above all, stays float32: positions in px need more than half precision's 11 bits.
"""

import io

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import GraphProto, NodeProto, TensorProto, helper, numpy_helper

from dfvs_export.precision.heavy_nodes import heavy_nodes

_LARGEST = float(np.finfo(np.float16).max)


def to_half(data: bytes, takes_images: bool) -> bytes:
    """ONNX file, of one in float32, with its heavy nodes in half precision.

    For ``takes_images`` see :func:`heavy_nodes`.
    """
    model = onnx.load_model(io.BytesIO(data))
    graph = model.graph
    _drop_copies(graph)
    weights = {t.name: t for t in graph.initializer if t.data_type == TensorProto.FLOAT}
    heavy = {node.name for node in heavy_nodes(graph, takes_images)}
    halved: set[str] = set()
    nodes: list[NodeProto] = []
    for node in graph.node:
        if node.name not in heavy:
            nodes.append(node)
            continue
        for index, name in enumerate(node.input):
            if name and name not in halved:
                halved.add(name)
                if name in weights:
                    graph.initializer.append(_halved(weights[name]))
                else:
                    nodes.append(_cast(name, _half(name), TensorProto.FLOAT16))
            node.input[index] = _half(name) if name else ""
        (single,) = node.output
        node.output[0] = f"{single}_computed"
        nodes += [node, _cast(node.output[0], single, TensorProto.FLOAT)]
    del graph.node[:]
    graph.node.extend(nodes)
    _drop_unused(graph)
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())


def _half(name: str) -> str:
    return f"{name}_half"


def _cast(name: str, out: str, kind: int) -> NodeProto:
    return helper.make_node("Cast", [name], [out], name=f"{out}/Cast", to=kind)


def _halved(tensor: TensorProto) -> TensorProto:
    values: NDArray[np.float32] = numpy_helper.to_array(tensor)
    within = np.clip(values, -_LARGEST, _LARGEST).astype(np.float16)
    return numpy_helper.from_array(within, _half(tensor.name))


def _drop_copies(graph: GraphProto) -> None:
    """Let layers that share weights read the weights themselves, not a copy."""
    weights = {tensor.name for tensor in graph.initializer}
    outputs = {o.name for o in graph.output}
    source: dict[str, str] = {}
    nodes: list[NodeProto] = []
    for node in graph.node:
        is_copy = node.op_type == "Identity" and node.input[0] in weights
        if is_copy and outputs.isdisjoint(node.output):
            source[node.output[0]] = node.input[0]
            continue
        node.input[:] = [source.get(name, name) for name in node.input]
        nodes.append(node)
    del graph.node[:]
    graph.node.extend(nodes)


def _drop_unused(graph: GraphProto) -> None:
    """Drop weights that only stood in for their halves."""
    used = {name for node in graph.node for name in node.input} | {o.name for o in graph.output}
    kept = [tensor for tensor in graph.initializer if tensor.name in used]
    del graph.initializer[:]
    graph.initializer.extend(kept)
