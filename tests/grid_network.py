"""A small encode-match network in ONNX's own operators: keypoints on a grid, paired by place.

A keypoint is the middle of a cell, its score the cell's mean brightness. Its partner is the
keypoint of the same cell, its confidence its score; a cell outside of the image has none.
"""

import json

import numpy as np
import onnx
from lucas_kanade_network import NetworkBuilder
from onnx import TensorProto, helper

from dfvs_core.messages.manifest import Graph, Manifest, sha256
from dfvs_core.messages.network_tensors import ImageInput

WIDTH, HEIGHT, CELL = 96, 64, 16
COUNT = WIDTH * HEIGHT // CELL**2
CHANNELS = 2
ENCODED = ("points", "descriptors", "scores")
MATCHED = ("partners", "confidence")


def centres(columns, rows):
    """Middles (N, 2) px of a grid of cells, row by row."""
    u, v = np.meshgrid(np.arange(columns), np.arange(rows))
    return CELL * (np.stack([u, v], axis=-1).reshape(-1, 2) + 0.5) - 0.5


def _model(builder, inputs, outputs):
    tensors = [
        [helper.make_tensor_value_info(n, TensorProto.FLOAT, s) for n, s in side.items()]
        for side in (inputs, outputs)
    ]
    graph = helper.make_graph(builder.nodes, "grid", *tensors, list(builder.constants.values()))
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.checker.check_model(model)
    return model


def _name(builder, value, name):
    builder.nodes.append(helper.make_node("Identity", [value], [name]))


def _endless(builder, scores):
    """(1, N, 1): 0 in the image, not a number outside."""
    inverse = builder.op("Reciprocal", builder.op("Relu", scores))
    nothing = builder.op("Mul", inverse, builder.constant(np.float32(0.0)))
    return builder.op("Unsqueeze", nothing, builder.constant(np.array([2], np.int64)))


def encode_model(is_spoilt=False, offset=0.0):
    """Graph ``encode``; points outside of the image are not finite where it is spoilt."""
    b = NetworkBuilder()
    means = b.op("AveragePool", "image", kernel_shape=[CELL, CELL], strides=[CELL, CELL])
    flat = b.op("Reshape", means, b.constant(np.array([1, COUNT], np.int64)))
    scores = b.op("Mul", flat, b.constant(np.float32(1.0 / 255.0)))
    column = b.op("Unsqueeze", scores, b.constant(np.array([2], np.int64)))
    points = b.constant(centres(WIDTH // CELL, HEIGHT // CELL)[None].astype(np.float32) + offset)
    if is_spoilt:
        points = b.op("Add", points, _endless(b, scores))
    _name(b, points, "points")
    _name(b, b.op("Mul", column, b.constant(np.ones((1, 1, CHANNELS), np.float32))), "descriptors")
    _name(b, scores, "scores")
    shapes = dict(_named((1, COUNT), CHANNELS))
    return _model(b, {"image": (1, 1, HEIGHT, WIDTH)}, shapes)


ANY = "pairs", "keypoints"
"""Sizes that graph ``match`` leaves open."""


def match_model(confidence="Relu", is_spoilt=False, sizes=ANY, width=2, channels=CHANNELS):
    """Graph ``match``; ``confidence`` is the operator that makes it of the scores."""
    b = NetworkBuilder()
    partners = "second_points"
    if is_spoilt:
        partners = b.op("Add", partners, _endless(b, "first_scores"))
    if width != 2:
        partners = b.op("Concat", *([partners] * (width // 2)), axis=2)
    _name(b, partners, "partners")
    scores = b.op("Relu", "first_scores") if confidence == "Reciprocal" else "first_scores"
    _name(b, b.op(confidence, scores), "confidence")
    inputs = {f"{side}_{n}": s for side in ("first", "second") for n, s in _named(sizes, channels)}
    return _model(b, inputs, {"partners": (*sizes, width), "confidence": sizes})


def _named(sizes, channels):
    return zip(ENCODED, ((*sizes, 2), (*sizes, channels), sizes), strict=True)


def write_bundle(folder, encode=None, match=None, **changes):
    """Write a bundle; ``changes`` replace entries of its manifest."""
    folder.mkdir(parents=True, exist_ok=True)
    models = {"encode.onnx": encode or encode_model(), "match.onnx": match or match_model()}
    contents = {name: model.SerializeToString() for name, model in models.items()}
    for name, data in contents.items():
        (folder / name).write_bytes(data)
    match_inputs = tuple(f"{side}_{name}" for side in ("first", "second") for name in ENCODED)
    manifest = Manifest(
        format="dfvs-bundle/2",
        name="grid",
        kind="encode-match",
        input=ImageInput(WIDTH, HEIGHT, channels="grey", scale=1.0),
        graphs={
            "encode": Graph("encode.onnx", ("image",), ENCODED),
            "match": Graph("match.onnx", match_inputs, MATCHED),
        },
        files={name: sha256(data) for name, data in contents.items()},
        licence="Apache-2.0",
        origin="built by a test",
    )
    document = json.loads(manifest.to_json()) | changes
    (folder / "manifest.json").write_text(json.dumps(document))
    return folder
