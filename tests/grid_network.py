"""A small encode-match network in ONNX's own operators: keypoints on a grid, paired by place.

A keypoint is the middle of a cell, its score the cell's mean brightness. Its partner is the
keypoint at the same place, its confidence its score; a cell outside of the image has none.
"""

import numpy as np
import onnx_network
from onnx import TensorProto
from onnx_network import NetworkBuilder

from dfvs_core.messages.network_tensors import ImageInput

WIDTH, HEIGHT, CELL = 96, 64, 16
COUNT = WIDTH * HEIGHT // CELL**2
CHANNELS = 2
ENCODED = ("points", "descriptors", "scores")
SIDES = ("first", "second")


def centres(columns, rows):
    """Middles (N, 2) px of a grid of cells, row by row."""
    u, v = np.meshgrid(np.arange(columns), np.arange(rows))
    return CELL * (np.stack([u, v], axis=-1).reshape(-1, 2) + 0.5) - 0.5


SPOILT_LEVEL = 10
"""Grey level below which a spoilt network's output is not finite; none of the trial image is."""


def _margin(builder, scores):
    """How far scores are above the spoilt ones."""
    return builder.op("Sub", scores, builder.constant(np.float32(SPOILT_LEVEL / 255.0)))


def _spoilt(builder, scores):
    """(1, N, 1): not a number for spoilt scores, 0 for others."""
    inverse = builder.op("Reciprocal", builder.op("Relu", _margin(builder, scores)))
    nothing = builder.op("Mul", inverse, builder.constant(np.float32(0.0)))
    return builder.op("Unsqueeze", nothing, builder.constant(np.array([2], np.int64)))


def encode_model(is_spoilt=False, offset=0.0, gain=1.0):
    """Graph ``encode``; ``offset`` is added to points, ``gain`` is a factor on scores."""
    b = NetworkBuilder()
    means = b.op("AveragePool", "image", kernel_shape=[CELL, CELL], strides=[CELL, CELL])
    flat = b.op("Reshape", means, b.constant(np.array([1, COUNT], np.int64)))
    scores = b.op("Mul", flat, b.constant(np.float32(gain / 255.0)))
    column = b.op("Unsqueeze", scores, b.constant(np.array([2], np.int64)))
    points = b.constant(centres(WIDTH // CELL, HEIGHT // CELL)[None].astype(np.float32) + offset)
    if is_spoilt:
        points = b.op("Add", points, _spoilt(b, scores))
    b.give(points, "points")
    b.give(b.op("Mul", column, b.constant(np.ones((1, 1, CHANNELS), np.float32))), "descriptors")
    b.give(scores, "scores")
    return b.model({"image": (1, 1, HEIGHT, WIDTH)}, dict(_named((1, COUNT), CHANNELS)))


ANY = "pairs", "keypoints"
"""Sizes that graph ``match`` leaves open."""


def match_model(confidence="Relu", is_spoilt=False, sizes=ANY, width=2, channels=CHANNELS):
    """Graph ``match``; ``confidence`` is the operator that makes it of what is not negative.

    Of the score of points with a partner (Relu) or all (Abs), or else of :func:`_margin`.
    """
    b = NetworkBuilder()
    axes = (b.constant(np.array([axis], np.int64)) for axis in (2, 1))
    sides = (b.op("Unsqueeze", f"{s}_points", axis) for s, axis in zip(SIDES, axes, strict=True))
    apart = b.op("ReduceSumSquare", b.op("Sub", *sides), axes=[3], keepdims=0)
    near = b.op("Cast", b.op("Less", apart, b.constant(np.float32(1.0))), to=TensorProto.FLOAT)
    index = b.op("ArgMax", near, axis=2, keepdims=1)
    partners = b.op("GatherND", "second_points", index, batch_dims=1)
    if is_spoilt:
        partners = b.op("Add", partners, _spoilt(b, "first_scores"))
    if width != 2:
        partners = b.op("Concat", *([partners] * (width // 2)), axis=2)
    b.give(partners, "partners")
    if confidence == "Relu":
        has_partner = b.op("ReduceMax", near, axes=[2], keepdims=0)
        made_of = b.op("Mul", "first_scores", has_partner)
    elif confidence == "Abs":
        made_of = "first_scores"
    else:
        made_of = _margin(b, "first_scores")
    if confidence == "Reciprocal":
        made_of = b.op("Relu", made_of)
    b.give(b.op(confidence, made_of), "confidence")
    inputs = {f"{side}_{n}": s for side in SIDES for n, s in _named(sizes, channels)}
    return b.model(inputs, {"partners": (*sizes, width), "confidence": sizes})


def _named(sizes, channels):
    return zip(ENCODED, ((*sizes, 2), (*sizes, channels), sizes), strict=True)


def write_bundle(folder, encode=None, match=None, **changes):
    """Write a bundle; ``changes`` replace entries of its manifest."""
    models = {"encode": encode or encode_model(), "match": match or match_model()}
    image = ImageInput(WIDTH, HEIGHT, channels="grey", scale=1.0)
    made = onnx_network.bundle_of("encode-match", models, image)
    return onnx_network.write_bundle(folder, made, **changes)
