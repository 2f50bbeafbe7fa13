"""Which operators may lose bits, and that half precision changes those and nothing else."""

import numpy as np
import onnx
import onnxruntime
import pytest
from onnx import TensorProto, helper, numpy_helper

from dfvs_export.precision.half import to_half
from dfvs_export.precision.heavy_nodes import carrying_nodes, heavy_nodes

SHAPE = (1, 4, 8, 8)


def convolution(name: str, source: str, groups: int = 1) -> onnx.NodeProto:
    inputs = [source, f"{name}_weights"]
    return helper.make_node(
        "Conv", inputs, [f"{name}_out"], name=name, pads=[1, 1, 1, 1], group=groups
    )


@pytest.fixture
def model() -> onnx.ModelProto:
    """Image -> first -> middle -> grouped -> times itself; plus middle -> step; that is flow."""
    rng = np.random.default_rng(4)
    nodes = [
        helper.make_node("Mul", ["image", "two"], ["scaled"], name="scale"),
        convolution("first", "scaled"),
        convolution("middle", "first_out"),
        convolution("grouped", "middle_out", groups=4),
        helper.make_node("MatMul", ["grouped_out", "grouped_out"], ["pairs"], name="pairs"),
        convolution("step", "middle_out"),
        helper.make_node("Add", ["pairs", "step_out"], ["flow"], name="add"),
    ]
    weights = {
        f"{name}_weights": rng.normal(size=(4, 1 if name == "grouped" else 4, 3, 3), scale=0.2)
        for name in ("first", "middle", "grouped", "step")
    }
    weights["two"] = np.array(2.0)
    graph = helper.make_graph(
        nodes,
        "small",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, SHAPE)],
        [helper.make_tensor_value_info("flow", TensorProto.FLOAT, SHAPE)],
        [numpy_helper.from_array(w.astype(np.float32), n) for n, w in weights.items()],
    )
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)


@pytest.mark.parametrize(
    ("takes_images", "heavy"), [(True, ["middle"]), (False, ["first", "middle"])]
)
def test_what_reads_an_image_or_gives_the_output_keeps_its_bits(model, takes_images, heavy) -> None:
    assert [node.name for node in heavy_nodes(model.graph, takes_images)] == heavy


def product(name: str, inputs: list[str]) -> onnx.NodeProto:
    return helper.make_node("MatMul", inputs, [f"{name}_out"], name=name)


def test_constants_of_the_method_are_no_layers() -> None:
    weights = {"layer": (32, 32), "sums": (1, 32), "few": (5, 32)}
    nodes = [
        product("by_layer", ["x", "layer"]),
        product("by_sums", ["sums", "by_layer_out"]),
        product("by_few", ["x", "few"]),
        product("of_two", ["by_layer_out", "by_few_out"]),  # what stands before gives features
    ]
    constants = [numpy_helper.from_array(np.ones(s, np.float32), n) for n, s in weights.items()]
    graph = helper.make_graph(nodes, "products", [], [], constants)
    assert [node.name for node in heavy_nodes(graph, False)] == ["by_layer"]


def test_what_lies_between_two_heavy_nodes_is_carried_and_nothing_else() -> None:
    nodes = [
        convolution("one", "x"),
        helper.make_node("Relu", ["one_out"], ["bent"], name="relu"),
        helper.make_node("Add", ["bent", "state"], ["sum"], name="add"),
        convolution("two", "sum"),
        helper.make_node("Relu", ["two_out"], ["end"], name="last"),
        helper.make_node("Relu", ["state"], ["other"], name="apart"),
        helper.make_node("Mul", ["bent", "bent"], ["square"], name="square"),
    ]
    graph = helper.make_graph(nodes, "chain", [], [])
    heavy = [node for node in graph.node if node.op_type == "Conv"]
    assert [node.name for node in carrying_nodes(graph, heavy)] == ["relu", "add"]


def run(data: bytes, image: np.ndarray) -> np.ndarray:
    session = onnxruntime.InferenceSession(data, providers=["CPUExecutionProvider"])
    (flow,) = session.run(["flow"], {"image": image})
    return flow


def test_half_precision_rounds_and_keeps_single_precision_outside(model) -> None:
    image = np.random.default_rng(5).random(SHAPE, dtype=np.float32)
    exact = run(model.SerializeToString(), image)
    data = to_half(model.SerializeToString(), takes_images=True)
    found = run(data, image)
    assert found.dtype == np.float32
    # eleven bits of the one convolution that was chosen, squared by the product behind it
    np.testing.assert_allclose(found, exact, rtol=0.0, atol=4e-3 * np.abs(exact).max())
    assert np.abs(found - exact).max() > 0.0


def test_half_precision_halves_the_chosen_weights_and_drops_the_whole_ones(model) -> None:
    made = onnx.load_model_from_string(to_half(model.SerializeToString(), takes_images=True))
    kinds = {tensor.name: tensor.data_type for tensor in made.graph.initializer}
    assert kinds.pop("middle_weights_half") == TensorProto.FLOAT16
    assert set(kinds) == {"first_weights", "grouped_weights", "step_weights", "two"}
    assert set(kinds.values()) == {TensorProto.FLOAT}


def test_weights_beyond_half_precision_stay_finite(model) -> None:
    (weights,) = (t for t in model.graph.initializer if t.name == "middle_weights")
    values = numpy_helper.to_array(weights).copy()
    values.flat[0] = 1e6
    weights.CopyFrom(numpy_helper.from_array(values, weights.name))
    made = onnx.load_model_from_string(to_half(model.SerializeToString(), takes_images=True))
    (halved,) = (t for t in made.graph.initializer if t.name == "middle_weights_half")
    assert np.isfinite(numpy_helper.to_array(halved)).all()


def test_layers_that_share_weights_share_their_halves(model) -> None:
    """The exporter lets the second one read a copy."""
    weights = next(node for node in model.graph.node if node.name == "middle").input
    copy = helper.make_node("Identity", [weights[1]], ["copied"], name="copy")
    second = convolution("second", "middle_out")
    second.input[1] = "copied"
    model.graph.node.insert(3, copy)
    model.graph.node.insert(4, second)
    next(node for node in model.graph.node if node.name == "step").input[0] = "second_out"
    image = np.random.default_rng(7).random(SHAPE, dtype=np.float32)
    data = to_half(model.SerializeToString(), takes_images=True)
    made = onnx.load_model_from_string(data).graph
    assert "Identity" not in {node.op_type for node in made.node}
    assert "middle_weights" not in {tensor.name for tensor in made.initializer}
    readers = [n.name for n in made.node if "middle_weights_half" in n.input]
    assert readers == ["middle", "second"]
    exact = run(model.SerializeToString(), image)
    np.testing.assert_allclose(run(data, image), exact, atol=4e-3 * np.abs(exact).max())
