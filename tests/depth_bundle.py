"""A small ``mono`` network in ONNX's own operators whose depth is known, and its bundle.

The depth is what the test gives, whatever the image; to the inverse depth the mean of the image and
of the focal length are added with the factors that the test names.
"""

import json

import numpy as np
import onnx
from lucas_kanade_network import NetworkBuilder
from onnx import TensorProto, helper

from dfvs_core.messages.manifest import BUNDLE_FORMAT, Graph, Manifest, sha256
from dfvs_core.messages.network_tensors import DepthOutput, ImageInput
from dfvs_models.bundle import Bundle

STRIDE = 2


def network(values, spread=None, *, by_image=0.0, by_focal=0.0):
    """ONNX model that gives ``values`` (h, w), and ``spread`` (h, w) where there is one."""
    b = NetworkBuilder()
    height, width = (STRIDE * n for n in values.shape)
    found = b.constant(np.asarray(values, np.float32)[None])
    grey = b.op("ReduceMean", "image", axes=[1, 2, 3], keepdims=1)
    one = b.constant(np.array([1, 1, 1], np.int64))
    for name, factor in ((grey, by_image), ("focal", by_focal)):
        part = b.op("Mul", b.op("Reshape", name, one), b.constant(np.float32(factor)))
        found = b.op("Add", found, part)
    b.nodes.append(helper.make_node("Identity", [found], ["inverse_depth"]))
    outputs = ["inverse_depth"]
    if spread is not None:
        constant = b.constant(np.asarray(spread, np.float32)[None])
        b.nodes.append(helper.make_node("Identity", [constant], ["sigma"]))
        outputs.append("sigma")
    shapes = {"image": (1, 3, height, width), "focal": (1, 1)}
    given = [helper.make_tensor_value_info(n, TensorProto.FLOAT, s) for n, s in shapes.items()]
    made = [
        helper.make_tensor_value_info(n, TensorProto.FLOAT, (1, *values.shape)) for n in outputs
    ]
    graph = helper.make_graph(b.nodes, "mono", given, made, list(b.constants.values()))
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.checker.check_model(model)
    return model


def bundle(values, spread=None, unit="1/m", *, by_image=0.0, by_focal=0.0):
    """Bundle of that network; without ``spread`` (h, w) the manifest says 0.2."""
    data = network(values, spread, by_image=by_image, by_focal=by_focal).SerializeToString()
    meaning = DepthOutput(
        "depth" if unit == "m" else "inverse-depth",
        unit,
        STRIDE,
        None if spread is not None else 0.2,
        0.1 if unit in ("m", "1/m") else None,
    )
    outputs = ("inverse_depth",) if spread is None else ("inverse_depth", "sigma")
    contents = {"mono.onnx": data}
    manifest = Manifest(
        format=BUNDLE_FORMAT,
        name="known-depth",
        kind="mono",
        input=ImageInput(STRIDE * values.shape[1], STRIDE * values.shape[0]),
        graphs={"mono": Graph("mono.onnx", ("image", "focal"), outputs)},
        files={name: sha256(data) for name, data in contents.items()},
        licence="Apache-2.0",
        origin="built by a test",
        depth=meaning,
    )
    return Bundle(manifest, contents)


def write_bundle(folder, made, **changes):
    """Write a bundle; ``changes`` replace entries of its manifest."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in made.contents.items():
        (folder / name).write_bytes(data)
    document = json.loads(made.manifest.to_json()) | changes
    (folder / "manifest.json").write_text(json.dumps(document))
    return folder
