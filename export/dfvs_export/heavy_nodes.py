"""Which operators of a graph bear fewer bits: those that cost time and do not carry flow."""

from __future__ import annotations

from collections.abc import Iterable

from onnx import GraphProto, NodeProto

_WEIGHING = frozenset({"Conv", "Gemm", "MatMul"})
_TURNS_FLOW_OVER = _WEIGHING | {"ArgMax"}
"""Where values stop being flow: behind these, an error is one of features."""


def heavy_nodes(graph: GraphProto, takes_pictures: bool, gives_flow: bool) -> list[NodeProto]:
    """Products with constant weights that may be computed with fewer bits.

    Three kinds stay as they are. What reads the picture itself, and what gives flow with nothing
    but adding and resampling behind it: there every lost bit is one of the picture or the flow,
    and both are cheap. And convolutions in groups, which ONNX Runtime was measured to compute
    more slowly in 8 bits than in 32.

    Parameters
    ----------
    graph : GraphProto
        With names for all nodes, weights as initialisers.
    takes_pictures : bool
        Whether its inputs are pictures, not features.
    gives_flow : bool
        Whether its outputs are flow and confidence, not features.
    """
    constants = {tensor.name for tensor in graph.initializer}
    kept: set[str] = set()
    if takes_pictures:
        kept |= _first(graph, constants)
    if gives_flow:
        kept |= _last(graph)
    return [
        node
        for node in graph.node
        if node.op_type in _WEIGHING
        and node.name not in kept
        and not constants.isdisjoint(node.input)
        and not _in_groups(node)
    ]


def _in_groups(node: NodeProto) -> bool:
    return any(a.name == "group" and a.i > 1 for a in node.attribute)


def _first(graph: GraphProto, constants: set[str]) -> set[str]:
    """Names of the nodes that no other product stands before."""
    raw = {i.name for i in graph.input} - constants  # nodes are in topological order
    found = set()
    for node in graph.node:
        if raw.isdisjoint(node.input):
            continue
        if node.op_type in _WEIGHING:
            found.add(node.name)
        else:
            raw.update(node.output)
    return found


def _last(graph: GraphProto) -> set[str]:
    """Names of the nodes that no other product stands behind on some way to an output."""
    direct = {o.name for o in graph.output}
    found = set()
    for node in reversed(graph.node):
        if direct.isdisjoint(node.output):
            continue
        if node.op_type in _TURNS_FLOW_OVER:
            found.add(node.name)
        else:
            direct.update(_filled(node.input))
    return found


def _filled(names: Iterable[str]) -> set[str]:
    """Names but for those of inputs that a node leaves out."""
    return {name for name in names if name}
