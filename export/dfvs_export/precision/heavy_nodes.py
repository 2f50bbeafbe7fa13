"""Which operators of a graph bear fewer bits: those that cost time and carry features."""

from collections.abc import Iterable, Mapping

from onnx import GraphProto, NodeProto

_PRODUCTS = frozenset({"Conv", "Gemm", "MatMul"})
_LEAST_TERMS = 16
"""Terms in a sum of a product from which on fewer bits save more than converting costs."""
_CARRYING = frozenset({"Add", "Concat", "Relu"})
"""What computes as well in 8 bits, so that nothing is converted between two heavy nodes."""


def heavy_nodes(graph: GraphProto, takes_images: bool) -> list[NodeProto]:
    """Layers that may be computed with fewer bits: products with learned weights.

    Three kinds stay as they are. What reads the image itself (of a graph that ``takes_images``, not
    features), and what gives flow, keypoints or descriptors with nothing but adding and resampling
    behind it: there every lost bit is one of the image or the output, and both are cheap. And
    convolutions in groups, which ONNX Runtime computes more slowly in 8 bits than in 32.
    The nodes have names, and weights are initialisers.
    """
    shapes = {tensor.name: tuple(tensor.dims) for tensor in graph.initializer}
    turning = {node.name for node in graph.node if _turns_over(node, shapes)}
    backwards = ((node.name, node.output, node.input) for node in reversed(graph.node))
    kept = _met({o.name for o in graph.output}, backwards, turning)
    if takes_images:
        images = {i.name for i in graph.input} - shapes.keys()
        kept |= _met(images, ((node.name, node.input, node.output) for node in graph.node), turning)
    return [
        node
        for node in graph.node
        if _is_layer(node, shapes) and node.name not in kept and not _in_groups(node)
    ]


def carrying_nodes(graph: GraphProto, heavy: Iterable[NodeProto]) -> list[NodeProto]:
    """Nodes on the way from one heavy node to others that can be computed in 8 bits with them."""
    behind = {name for node in heavy for name in node.output}
    found: list[NodeProto] = []
    for node in graph.node:  # in topological order
        if node.op_type in _CARRYING and not behind.isdisjoint(node.input):
            found.append(node)
            behind.update(node.output)
    before = {name for node in heavy for name in node.input}
    leading: list[NodeProto] = []
    for node in reversed(found):
        if not before.isdisjoint(node.output):
            leading.append(node)
            before.update(node.input)
    return leading[::-1]


def _is_layer(node: NodeProto, shapes: Mapping[str, tuple[int, ...]]) -> bool:
    """Whether a node multiplies by learned weights, which stand second.

    A constant that stands first, or is a few numbers only, is one of the method's own, such as
    the sums of a least-squares fit.
    """
    if node.op_type not in _PRODUCTS or node.input[1] not in shapes:
        return False
    return node.op_type == "Conv" or min(shapes[node.input[1]]) >= _LEAST_TERMS


def _turns_over(node: NodeProto, shapes: Mapping[str, tuple[int, ...]]) -> bool:
    """Whether values stop being image or output here: behind it, an error is one of features."""
    if node.op_type == "ArgMax" or _is_layer(node, shapes):
        return True
    return node.op_type == "MatMul" and shapes.keys().isdisjoint(node.input)


def _in_groups(node: NodeProto) -> bool:
    return any(a.name == "group" and a.i > 1 for a in node.attribute)


def _met(
    values: set[str], ways: Iterable[tuple[str, Iterable[str], Iterable[str]]], turning: set[str]
) -> set[str]:
    """Names of the turning nodes that are met first on the ways that lead away from some values.

    ``ways`` are all nodes in their order on them: the name, and the values on either side.
    """
    reached, found = set(values), set()
    for name, near, far in ways:
        if reached.isdisjoint(near):
            continue
        if name in turning:
            found.add(name)
        else:
            reached.update(value for value in far if value)  # one that is left out has no name
    return found
