"""A flow network that works, and that misbehaves on purpose when it sees a certain blue.

It fits the red and green ramps of ``wall.ramp_texture`` in both images by an affine map and
so knows the flow between them. The blue of the first image chooses what goes wrong: a network
that is damaged or was trained badly gives NaN or rubbish for some images and not for others as
well. It is an ordinary model bundle: the service has no part in the trick.
"""

import enum
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from dfvs_core.messages.manifest import MANIFEST_NAME, Graph, Manifest, sha256
from dfvs_core.messages.network_tensors import FlowOutput, ImageInput

WIDTH, HEIGHT = 160, 120
_FILE = "pair.onnx"
_TOLERANCE = 0.04
_LEAST_DET = 1e-9
"""Keeps the flow finite where both ramps run the same way; on the wall it is 1e-5."""
_GARBAGE_PX = 40.0
_SHIFT_PX = 9.0
_SLOW_TRIPS = 400_000
_ENDLESS_TRIPS = 1 << 50


class Misbehaviour(enum.Enum):
    """What the network does, and the share of blue that makes it do so."""

    NAN = 0.1
    GARBAGE = 0.2
    ONE_WAY = 0.3
    """Flow there and flow back contradict each other: no point is to be trusted."""
    SLOW = 0.7
    STUCK = 0.9

    @property
    def blue(self) -> int:
        """Level of the blue channel, 0 to 255."""
        return round(255 * self.value)


class _Nodes:
    """Collects nodes and constants; every call gives the name of its result."""

    def __init__(self) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.constants: list[onnx.TensorProto] = []

    def op(self, kind: str, *inputs: str, **attributes: Any) -> str:
        name = f"t{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, list(inputs), [name], **attributes))
        return name

    def constant(self, values: object, dtype: type = np.float32) -> str:
        name = f"c{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.asarray(values, dtype), name))
        return name

    def part(self, x: str, axis: int, start: int, end: int) -> str:
        ends = [self.constant([value], np.int64) for value in (start, end, axis)]
        return self.op("Slice", x, *ends)

    def mean(self, x: str) -> str:
        """Mean (1, C, 1, 1) over the image."""
        return self.op("ReduceMean", x, axes=[2, 3], keepdims=1)


def _affine(n: _Nodes, image: str) -> tuple[str, str, str]:
    """Red and green at the centre, and their slopes per px along u and v, each (1, 2, 1, 1)."""
    colours = n.part(image, 1, 0, 2)
    slopes = []
    for axis, size in ((3, WIDTH), (2, HEIGHT)):
        low = n.mean(n.part(colours, axis, 0, size // 2))
        high = n.mean(n.part(colours, axis, size // 2, size))
        rise = n.op("Sub", high, low)
        slopes.append(n.op("Mul", rise, n.constant(2.0 / size)))
    return n.mean(colours), slopes[0], slopes[1]


def _flow(n: _Nodes) -> str:
    """Flow (1, 2, H, W): where the other image has the colours of the current one."""
    centre, along_u, along_v = _affine(n, "current")
    other, other_u, other_v = _affine(n, "other")
    u = n.constant(np.broadcast_to(np.arange(WIDTH) + 0.5 - WIDTH / 2, (1, 1, HEIGHT, WIDTH)))
    rows = (np.arange(HEIGHT) + 0.5 - HEIGHT / 2)[:, None]
    v = n.constant(np.broadcast_to(rows, (1, 1, HEIGHT, WIDTH)))
    rise = n.op("Add", n.op("Mul", along_u, u), n.op("Mul", along_v, v))
    wanted = n.op("Add", rise, n.op("Sub", centre, other))
    red, green = n.part(wanted, 1, 0, 1), n.part(wanted, 1, 1, 2)
    (a, c), (b, d) = ((n.part(s, 1, 0, 1), n.part(s, 1, 1, 2)) for s in (other_u, other_v))
    det = n.op("Sub", n.op("Mul", a, d), n.op("Mul", b, c))
    det = n.op("Add", det, n.constant(_LEAST_DET))
    at_u = n.op("Div", n.op("Sub", n.op("Mul", d, red), n.op("Mul", b, green)), det)
    at_v = n.op("Div", n.op("Sub", n.op("Mul", a, green), n.op("Mul", c, red)), det)
    return n.op("Concat", n.op("Sub", at_u, u), n.op("Sub", at_v, v), axis=1)


def _chosen(n: _Nodes, blue: str, what: Misbehaviour) -> str:
    """1 where the blue asks for it, else 0: (1, 1, 1, 1)."""
    off = n.op("Abs", n.op("Sub", blue, n.constant(what.value)))
    return n.op("Cast", n.op("Less", off, n.constant(_TOLERANCE)), to=TensorProto.FLOAT)


def _delay(n: _Nodes, slow: str, stuck: str) -> str:
    """Zero (1,), after as many rounds of a loop as were asked for."""
    trips = n.op(
        "Add",
        n.op("Mul", n.op("Cast", slow, to=TensorProto.INT64), n.constant(_SLOW_TRIPS, np.int64)),
        n.op(
            "Mul", n.op("Cast", stuck, to=TensorProto.INT64), n.constant(_ENDLESS_TRIPS, np.int64)
        ),
    )
    count = n.op("Reshape", trips, n.constant([1], np.int64))
    one = helper.make_tensor_value_info
    body = helper.make_graph(
        [helper.make_node("Identity", ["go"], ["on"]), helper.make_node("Sin", ["x"], ["y"])],
        "round",
        [
            one("i", TensorProto.INT64, []),
            one("go", TensorProto.BOOL, []),
            one("x", TensorProto.FLOAT, [1]),
        ],
        [one("on", TensorProto.BOOL, []), one("y", TensorProto.FLOAT, [1])],
    )
    start = n.constant([0.0])
    return n.op("Loop", count, n.constant(True, np.bool_), start, body=body)


def faulty_network() -> onnx.ModelProto:
    """Build the network."""
    n = _Nodes()
    blue = n.mean(n.part("current", 1, 2, 3))
    flow = _flow(n)
    rng = np.random.default_rng(0)
    garbage = n.constant(rng.normal(0.0, _GARBAGE_PX, (1, 2, HEIGHT, WIDTH)))
    flow = n.op("Add", flow, n.op("Mul", garbage, _chosen(n, blue, Misbehaviour.GARBAGE)))
    shift = n.op("Mul", n.constant(_SHIFT_PX), _chosen(n, blue, Misbehaviour.ONE_WAY))
    flow = n.op("Add", flow, shift)
    slow, stuck = (_chosen(n, blue, m) for m in (Misbehaviour.SLOW, Misbehaviour.STUCK))
    flow = n.op("Add", flow, _delay(n, slow, stuck))
    nan = _chosen(n, blue, Misbehaviour.NAN)
    nought = n.op("Mul", nan, n.constant(0.0))
    share = n.op("Div", nought, n.op("Sub", n.constant(1.0), nan))  # 0 / 0 where chosen
    n.nodes.append(helper.make_node("Add", [flow, share], ["flow"]))
    shape = (1, 3, HEIGHT, WIDTH)
    inputs = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)
        for name in ("current", "other")
    ]
    output = helper.make_tensor_value_info("flow", TensorProto.FLOAT, (1, 2, HEIGHT, WIDTH))
    graph = helper.make_graph(n.nodes, "ramp", inputs, [output], n.constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.checker.check_model(model)
    return model


def write_bundle(folder: Path) -> Path:
    """Write the network as a model bundle; returns its folder."""
    folder.mkdir(parents=True, exist_ok=True)
    data = faulty_network().SerializeToString()
    (folder / _FILE).write_bytes(data)
    manifest = Manifest(
        format="dfvs-bundle/2",
        name="faulty-ramp",
        kind="pair",
        input=ImageInput(WIDTH, HEIGHT),
        graphs={"pair": Graph(_FILE, ("current", "other"), ("flow",))},
        files={_FILE: sha256(data)},
        licence="Apache-2.0",
        origin="built by dfvs_robustness.harness.network, to misbehave on purpose",
        flow=FlowOutput(),
    )
    (folder / MANIFEST_NAME).write_text(manifest.to_json(), encoding="utf-8")
    return folder
