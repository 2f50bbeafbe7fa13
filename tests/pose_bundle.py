"""A small ``pose`` network in ONNX's own operators whose pose is known, and its bundle.

The translation is what the test gives, and the difference of the means of both images is added to
its x; the rotation is what the test gives, and the focal length is added to its last value.
"""

import numpy as np
import onnx
from lucas_kanade_network import NetworkBuilder
from onnx import TensorProto, helper

from dfvs_core.messages.manifest import BUNDLE_FORMAT, Graph, Manifest, sha256
from dfvs_core.messages.network_tensors import ImageInput, PoseOutput
from dfvs_models.bundle import Bundle

SIZE = (32, 24)
INPUTS, OUTPUTS = ("first", "second", "focal"), ("translation", "rotation")


def network(translation, rotation):
    b = NetworkBuilder()
    means = [b.op("ReduceMean", name, axes=[1, 2, 3], keepdims=1) for name in INPUTS[:2]]
    row = b.constant(np.array([1, 1], np.int64))
    apart = b.op("Reshape", b.op("Sub", *means), row)
    last = np.eye(len(rotation), dtype=np.float32)[-1:]
    for value, part, along, name in (
        (translation, apart, np.array([[1, 0, 0]], np.float32), "translation"),
        (rotation, "focal", last, "rotation"),
    ):
        added = b.op("Mul", part, b.constant(along))
        found = b.op("Add", b.constant(np.array([value], np.float32)), added)
        b.nodes.append(helper.make_node("Identity", [found], [name]))
    shape = (1, 1, SIZE[1], SIZE[0])
    shapes = {"first": shape, "second": shape, "focal": (1, 1)}
    given = [helper.make_tensor_value_info(n, TensorProto.FLOAT, s) for n, s in shapes.items()]
    sizes = {"translation": (1, 3), "rotation": (1, len(rotation))}
    made = [helper.make_tensor_value_info(n, TensorProto.FLOAT, s) for n, s in sizes.items()]
    graph = helper.make_graph(b.nodes, "pose", given, made, list(b.constants.values()))
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.checker.check_model(model)
    return model


def bundle(translation, rotation, unit="m"):
    """Bundle of that network; a rotation of four values is a quaternion."""
    contents = {"pose.onnx": network(translation, rotation).SerializeToString()}
    manifest = Manifest(
        format=BUNDLE_FORMAT,
        name="known-pose",
        kind="pose",
        input=ImageInput(*SIZE, channels="grey"),
        graphs={"pose": Graph("pose.onnx", INPUTS, OUTPUTS)},
        files={name: sha256(data) for name, data in contents.items()},
        licence="Apache-2.0",
        origin="built by a test",
        pose=PoseOutput(unit, "quaternion" if len(rotation) == 4 else "vector"),
    )
    return Bundle(manifest, contents)
