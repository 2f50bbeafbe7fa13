"""Depth network of a ``mono`` bundle."""

from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np

from dfvs_core.depth.network import NetworkDepth
from dfvs_core.errors import ModelError
from dfvs_core.geometry.arrays import Float32Array, ImageArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.network_tensors import ImageInput
from dfvs_models.bundle import Bundle
from dfvs_models.onnx_session import Execution, OnnxGraph, trial_image
from dfvs_models.pair import image_tensor

FOCAL_SHAPE = (1, 1)
_TRIAL_FOV_RAD = 1.3


@dataclass(frozen=True, slots=True)
class FittedImage:
    """An image in the network's size, its pixels square, its borders repeated where it is short.

    ``image`` (h, w, 3) uint8 RGB; ``corner_px`` (x, y) and ``size_px`` (width, height) are the part
    that shows the image; ``focal`` is the focal length over the width of the whole.
    """

    image: ImageArray
    corner_px: tuple[int, int]
    size_px: tuple[int, int]
    focal: float


def fit_image(image: ImageArray, camera: CameraModel, spec: ImageInput) -> FittedImage:
    """Fit an image (H, W, 3) uint8 RGB of this camera into the network's."""
    height, width = image.shape[:2]
    stretch = camera.fx / camera.fy
    scale = min(spec.width / width, spec.height / (height * stretch))
    size = (
        min(max(round(width * scale), 1), spec.width),
        min(max(round(height * stretch * scale), 1), spec.height),
    )
    shrinks = size[0] < width
    method = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    resized = cv2.resize(image, size, interpolation=method)
    x, y = (spec.width - size[0]) // 2, (spec.height - size[1]) // 2
    right, bottom = spec.width - size[0] - x, spec.height - size[1] - y
    whole = cv2.copyMakeBorder(resized, y, bottom, x, right, cv2.BORDER_REPLICATE)
    focal = camera.fx * size[0] / width / spec.width
    return FittedImage(cast(ImageArray, whole), (x, y), size, focal)


def trial_view(spec: ImageInput) -> FittedImage:
    """Image that a network is tried out on."""
    image = np.repeat(trial_image(spec.width, spec.height)[..., None], 3, axis=2)
    camera = CameraModel.from_horizontal_fov(spec.width, spec.height, _TRIAL_FOV_RAD)
    return fit_image(image, camera, spec)


class DepthNetwork:
    """Runs a ``mono`` bundle; a ``DepthEstimator``. Distortion is not taken out of the image.

    Raises
    ------
    ModelError
        If the graph's tensors are not what the manifest says, or its output is not finite.
    """

    def __init__(self, bundle: Bundle, execution: Execution) -> None:
        manifest = bundle.manifest
        if manifest.depth is None:
            raise ModelError(
                f"bundle {manifest.name!r} is of the kind {manifest.kind!r}, which gives no depth",
                "a bundle of the kind 'mono'",
            )
        self._input, self._meaning = manifest.input, manifest.depth
        self._graph = OnnxGraph(bundle, "mono", execution)
        image = (1, self._input.channel_count, self._input.height, self._input.width)
        self._graph.require_shapes((image, FOCAL_SHAPE)[: len(self._graph.inputs)])
        self._try_out()

    @property
    def unit(self) -> str:
        """Of the network's depth; see ``dfvs_core.depth.network.DepthUnit``."""
        return self._meaning.unit

    def estimate(self, image: ImageArray, camera: CameraModel) -> NetworkDepth:
        """Depth (H, W) of an image (H, W, 3) uint8 RGB that this camera took.

        Raises
        ------
        ImageError
            If the image is not the camera's.
        """
        camera.check_size(image, "the image")
        fitted = fit_image(image, camera, self._input)
        raw = self._run(fitted)
        depth = self._in_image(raw[0][0], fitted, image.shape[:2])
        if self._meaning.quantity == "depth":
            rho = np.divide(np.float32(1.0), depth, out=np.zeros_like(depth), where=depth > 0)
        else:
            rho = depth
        if self._meaning.spread is None:
            spread = self._in_image(raw[1][0], fitted, image.shape[:2])
        else:
            spread = np.full_like(rho, self._meaning.spread)
        return NetworkDepth(rho, spread, self._meaning.unit, self._meaning.scale_spread)

    def _run(self, fitted: FittedImage) -> list[Float32Array]:
        """Outputs of the graph."""
        image = image_tensor(fitted.image, self._input)
        tensors = [image, np.full(FOCAL_SHAPE, fitted.focal, np.float32)]
        return self._graph.run(tensors[: len(self._graph.inputs)])

    def _in_image(
        self, values: Float32Array, fitted: FittedImage, size: tuple[int, ...]
    ) -> Float32Array:
        """Values (H, W) for an image of ``size`` from the network's (h, w)."""
        stride = self._meaning.stride
        u, v = (
            ((np.arange(n) + 0.5) * part / n + corner) / stride - 0.5
            for n, part, corner in zip(size[::-1], fitted.size_px, fitted.corner_px, strict=True)
        )
        at = np.meshgrid(u.astype(np.float32), v.astype(np.float32))
        found = cv2.remap(values, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(found, np.float32)

    def _try_out(self) -> None:
        """Run the network once: shapes that lie and weights that are not finite show up."""
        self._graph.require_outputs()
        stride = self._meaning.stride
        shape = (1, self._input.height // stride, self._input.width // stride)
        outputs = self._run(trial_view(self._input))
        self._graph.require_values(outputs, [shape] * len(outputs), "finite depth")
