"""A small encode-match network in ONNX's own operators: keypoints on a grid, paired by place.

A keypoint is the middle of a cell, its score the cell's mean brightness. Its partner is the
keypoint of the same cell, its confidence its score; a cell outside of the image has none.
"""

import numpy as np
import onnx_network
from onnx_network import NetworkBuilder

from dfvs_core.messages.network_tensors import ImageInput

WIDTH, HEIGHT, CELL = 96, 64, 16
COUNT = WIDTH * HEIGHT // CELL**2
CHANNELS = 2
ENCODED = ("points", "descriptors", "scores")


def centres(columns, rows):
    """Middles (N, 2) px of a grid of cells, row by row."""
    u, v = np.meshgrid(np.arange(columns), np.arange(rows))
    return CELL * (np.stack([u, v], axis=-1).reshape(-1, 2) + 0.5) - 0.5


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
    b.give(points, "points")
    b.give(b.op("Mul", column, b.constant(np.ones((1, 1, CHANNELS), np.float32))), "descriptors")
    b.give(scores, "scores")
    return b.model({"image": (1, 1, HEIGHT, WIDTH)}, dict(_named((1, COUNT), CHANNELS)))


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
    b.give(partners, "partners")
    scores = b.op("Relu", "first_scores") if confidence == "Reciprocal" else "first_scores"
    b.give(b.op(confidence, scores), "confidence")
    inputs = {f"{side}_{n}": s for side in ("first", "second") for n, s in _named(sizes, channels)}
    return b.model(inputs, {"partners": (*sizes, width), "confidence": sizes})


def _named(sizes, channels):
    return zip(ENCODED, ((*sizes, 2), (*sizes, channels), sizes), strict=True)


def write_bundle(folder, encode=None, match=None, **changes):
    """Write a bundle; ``changes`` replace entries of its manifest."""
    models = {"encode": encode or encode_model(), "match": match or match_model()}
    image = ImageInput(WIDTH, HEIGHT, channels="grey", scale=1.0)
    made = onnx_network.bundle_of("encode-match", models, image)
    return onnx_network.write_bundle(folder, made, **changes)
