"""A small ``mono`` network in ONNX's own operators whose depth is known, and its bundle.

The depth is what the test gives, whatever the image; to the inverse depth the mean of the image and
of the focal length are added with the factors that the test names.
"""

import numpy as np
from onnx_network import NetworkBuilder, bundle_of

from dfvs_core.messages.network_tensors import DepthOutput, ImageInput

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
    b.give(found, "inverse_depth")
    made = {"inverse_depth": (1, *values.shape)}
    if spread is not None:
        b.give(b.constant(np.asarray(spread, np.float32)[None]), "sigma")
        made["sigma"] = (1, *values.shape)
    return b.model({"image": (1, 3, height, width), "focal": (1, 1)}, made)


def bundle(values, spread=None, unit="1/m", *, by_image=0.0, by_focal=0.0):
    """Bundle of that network; without ``spread`` (h, w) the manifest says 0.2."""
    model = network(values, spread, by_image=by_image, by_focal=by_focal)
    meaning = DepthOutput(
        "depth" if unit == "m" else "inverse-depth",
        unit,
        STRIDE,
        None if spread is not None else 0.2,
        0.1 if unit in ("m", "1/m") else None,
    )
    size = ImageInput(STRIDE * values.shape[1], STRIDE * values.shape[0])
    return bundle_of("mono", {"mono": model}, size, depth=meaning)
