"""Small networks in ONNX's own operators, and bundles of them."""

import json

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from dfvs_core.messages.manifest import Graph, Manifest, sha256
from dfvs_models.bundle import Bundle


class NetworkBuilder:
    """Collects nodes and constants; every method gives the name of its result."""

    def __init__(self):
        self.nodes, self.constants = [], {}

    def op(self, kind, *inputs, **attributes):
        out = f"t{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, list(inputs), [out], **attributes))
        return out

    def constant(self, values):
        name = f"c{len(self.constants)}"
        self.constants[name] = numpy_helper.from_array(np.asarray(values), name)
        return name

    def filtered(self, x, kernel):
        """2-D filter of one channel, the border repeated."""
        kernel = np.atleast_2d(np.asarray(kernel, np.float32))
        v, u = kernel.shape[0] // 2, kernel.shape[1] // 2
        pads = self.constant(np.array([0, 0, v, u, 0, 0, v, u], np.int64))
        padded = self.op("Pad", x, pads, mode="edge")
        return self.op("Conv", padded, self.constant(kernel[None, None]))

    def give(self, value, name):
        """Give a result the name of an output."""
        self.nodes.append(helper.make_node("Identity", [value], [name]))

    def model(self, inputs, outputs):
        """Return the checked model; both sides are shapes by name."""
        tensors = [
            [helper.make_tensor_value_info(n, TensorProto.FLOAT, s) for n, s in side.items()]
            for side in (inputs, outputs)
        ]
        graph = helper.make_graph(self.nodes, "built", *tensors, list(self.constants.values()))
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
        onnx.checker.check_model(model)
        return model


def bundle_of(kind, models, image, **output):
    """Bundle of the models by role, whose manifest says of them what is true."""
    contents = {f"{role}.onnx": model.SerializeToString() for role, model in models.items()}
    graphs = {
        role: Graph(f"{role}.onnx", *(tuple(t.name for t in side) for side in (g.input, g.output)))
        for role, g in ((role, model.graph) for role, model in models.items())
    }
    manifest = Manifest(
        format="dfvs-bundle/2",
        name=f"tiny-{kind}",
        kind=kind,
        input=image,
        graphs=graphs,
        files={name: sha256(data) for name, data in contents.items()},
        licence="Apache-2.0",
        origin="built by a test",
        **output,
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
