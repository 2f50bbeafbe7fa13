"""Running a bundle's graphs once, to check, to calibrate and to time them."""

import numpy as np

from dfvs_core.geometry.arrays import Float32Array, ImageArray
from dfvs_models.bundle import Bundle
from dfvs_models.encode_match import FREE_AXES
from dfvs_models.onnx_session import Execution, OnnxGraph
from dfvs_models.pair import image_tensor, pair_tensors

ImagePair = tuple[ImageArray, ImageArray]
"""Two images (H, W, 3) uint8 RGB of one size."""
FOCAL = 0.65
"""Focal length over width for networks that ask for it: a field of view of 75 degrees."""


class BundleRunner:
    """Runs a bundle, and judges nothing.

    Raises
    ------
    ModelError
        If its graphs cannot be loaded.
    """

    def __init__(self, bundle: Bundle, threads: int = 2) -> None:
        self.bundle = bundle
        self._graphs = {
            role: OnnxGraph(bundle, role, Execution(threads), FREE_AXES if role == "match" else ())
            for role in bundle.manifest.graphs
        }

    def tensor(self, image: ImageArray) -> Float32Array:
        """Image (H, W, 3) uint8 RGB to (1, C, h, w), as the manifest says."""
        return image_tensor(image, self.bundle.manifest.input)

    def encode(self, image: ImageArray, focal: float = FOCAL) -> list[Float32Array]:
        """Keypoints of an image; for other kinds than ``encode-match``, the inputs for it.

        ``focal`` is its focal length over its width.
        """
        tensor, manifest = self.tensor(image), self.bundle.manifest
        inputs = [tensor, np.full((1, 1), focal, np.float32)]
        if manifest.kind == "pair":
            return inputs[:1]
        if manifest.kind == "pose":
            return inputs
        if manifest.kind == "mono":
            return inputs[: len(manifest.graphs["mono"].inputs)]
        return self._graphs["encode"].run([tensor])

    def match(self, first: list[Float32Array], second: list[Float32Array]) -> list[Float32Array]:
        """Outputs of the last graph, from what ``encode`` gave of two images.

        Of a ``mono`` bundle: the first one's depth.
        """
        return self._graphs[self.last_role].run(list(self.feeds(first, second).values()))

    @property
    def last_role(self) -> str:
        """Role of the last graph."""
        kind = self.bundle.manifest.kind
        return "match" if kind == "encode-match" else kind

    def feeds(
        self, first: list[Float32Array], second: list[Float32Array]
    ) -> dict[str, Float32Array]:
        """Name what goes into the last graph, from what ``encode`` gave of two images."""
        manifest = self.bundle.manifest
        if manifest.kind == "encode-match":
            return manifest.match_feeds(first, second)
        if manifest.kind == "mono":
            return dict(zip(manifest.graphs["mono"].inputs, first, strict=True))
        tensors = pair_tensors(first[0], second[0], manifest.input)
        return dict(zip(manifest.graphs[manifest.kind].inputs, (*tensors, *first[1:]), strict=True))
