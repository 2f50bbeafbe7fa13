"""A small ``pose`` network in ONNX's own operators whose pose is known, and its bundle.

The translation is what the test gives, and the difference of the means of both images is added to
its x; the rotation is what the test gives, and the focal length is added to its last value.
"""

import numpy as np
from onnx_network import NetworkBuilder, bundle_of

from dfvs_core.messages.network_tensors import ImageInput, PoseOutput

SIZE = (32, 24)


def network(translation, rotation):
    b = NetworkBuilder()
    means = [b.op("ReduceMean", name, axes=[1, 2, 3], keepdims=1) for name in ("first", "second")]
    row = b.constant(np.array([1, 1], np.int64))
    apart = b.op("Reshape", b.op("Sub", *means), row)
    last = np.eye(len(rotation), dtype=np.float32)[-1:]
    for value, part, along, name in (
        (translation, apart, np.array([[1, 0, 0]], np.float32), "translation"),
        (rotation, "focal", last, "rotation"),
    ):
        added = b.op("Mul", part, b.constant(along))
        b.give(b.op("Add", b.constant(np.array([value], np.float32)), added), name)
    shape = (1, 1, SIZE[1], SIZE[0])
    shapes = {"first": shape, "second": shape, "focal": (1, 1)}
    return b.model(shapes, {"translation": (1, 3), "rotation": (1, len(rotation))})


def bundle(translation, rotation, unit="m"):
    """Bundle of that network; a rotation of four values is a quaternion."""
    meaning = PoseOutput(unit, "quaternion" if len(rotation) == 4 else "vector")
    models = {"pose": network(translation, rotation)}
    return bundle_of("pose", models, ImageInput(*SIZE, channels="grey"), pose=meaning)
