"""A small but real flow network: two steps of Lucas and Kanade (1981) in ONNX's own operators.

Blur, gradients, the 2 x 2 normal equations over a window, a warp by GridSample, and once more.
It finds motion of a few pixels. The manifest beside it says how pictures enter and flow leaves.
"""

import numpy as np
import onnx_network
from onnx_network import NetworkBuilder

from dfvs_core.messages.network_tensors import FlowOutput, ImageInput

WIDTH, HEIGHT = 160, 120
_WINDOW = 15


def _windowed(b, x):
    """Mean over the window."""
    return b.filtered(x, np.full((_WINDOW, _WINDOW), 1.0 / _WINDOW**2))


def _grey(b, x, channels):
    weights = np.full((1, channels, 1, 1), 255.0 / channels, np.float32)
    taps = np.exp(-0.5 * (np.arange(-6, 7) / 2.0) ** 2)
    taps = taps / taps.sum()
    grey = b.op("Conv", x, b.constant(weights))
    return b.filtered(b.filtered(grey, taps[None]), taps[:, None])


def _step(b, current, other):
    """Flow (1, 2, H, W) of small motion from the normal equations at every pixel."""
    gu = b.filtered(current, [[-0.5, 0.0, 0.5]])
    gv = b.filtered(current, [[-0.5], [0.0], [0.5]])
    gt = b.op("Sub", other, current)
    uu, uv, vv = (_windowed(b, b.op("Mul", p, q)) for p, q in ((gu, gu), (gu, gv), (gv, gv)))
    ut, vt = (_windowed(b, b.op("Mul", p, gt)) for p in (gu, gv))
    det = b.op("Sub", b.op("Mul", uu, vv), b.op("Mul", uv, uv))
    det = b.op("Add", det, b.constant(np.float32(1e-3)))
    u = b.op("Sub", b.op("Mul", uv, vt), b.op("Mul", vv, ut))
    v = b.op("Sub", b.op("Mul", uv, ut), b.op("Mul", uu, vt))
    return b.op("Div", b.op("Concat", u, v, axis=1), det)


def _warp(b, picture, flow):
    """Picture (1, 1, H, W) brought back by the flow, bilinear."""
    u, v = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    grid = np.stack([u * 2 / WIDTH - 1, v * 2 / HEIGHT - 1], axis=-1)[None].astype(np.float32)
    shift = b.op("Transpose", flow, perm=[0, 2, 3, 1])
    shift = b.op("Mul", shift, b.constant(np.float32([2 / WIDTH, 2 / HEIGHT])))
    at = b.op("Add", b.constant(grid), shift)
    return b.op("GridSample", picture, at, mode="bilinear", padding_mode="border")


def _pictures(b, layout, channels):
    """Shapes of the inputs by name, and the names of the two pictures (1, C, H, W)."""
    spec = ImageInput(WIDTH, HEIGHT, layout=layout, channels=channels)
    names = ("current", "other") if layout == "separate" else ("pictures",)
    inputs = dict(zip(names, spec.pair_shapes(), strict=True))
    if layout == "separate":
        return inputs, names
    axis = b.constant(np.array([1], np.int64))
    size = 1 if layout == "stack" else spec.channel_count
    halves = []
    for k in (0, 1):
        ends = (b.constant(np.array([n * size], np.int64)) for n in (k, k + 1))
        half = b.op("Slice", names[0], *ends, axis)
        halves.append(b.op("Squeeze", half, axis) if layout == "stack" else half)
    return inputs, halves


def network(layout="separate", channels="rgb", flow=None):
    """ONNX model whose input and output follow the arguments."""
    flow = flow or FlowOutput()
    b = NetworkBuilder()
    inputs, pictures = _pictures(b, layout, channels)
    current, other = (_grey(b, p, 1 if channels == "grey" else 3) for p in pictures)
    first = _step(b, current, other)
    total = b.op("Add", first, _step(b, current, _warp(b, other, first)))
    k = flow.stride
    total = b.op("AveragePool", total, kernel_shape=[k, k], strides=[k, k])
    if flow.order == "vu":
        total = b.op("Gather", total, b.constant(np.array([1, 0], np.int64)), axis=1)
    b.give(b.op("Mul", total, b.constant(np.float32(1.0 / flow.scale))), "flow")
    return b.model(inputs, {"flow": (1, 2, HEIGHT // k, WIDTH // k)})


def write_bundle(folder, layout="separate", channels="rgb", output=None, **changes):
    """Write a bundle; ``changes`` replace entries of its manifest."""
    image = ImageInput(WIDTH, HEIGHT, layout=layout, channels=channels)
    models = {"pair": network(layout, channels, output)}
    made = onnx_network.bundle_of("pair", models, image, flow=output or FlowOutput())
    return onnx_network.write_bundle(folder, made, **changes)
