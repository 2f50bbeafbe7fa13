"""Running a bundle's graphs once, to check, to calibrate and to time them."""

from __future__ import annotations

from collections.abc import Mapping

from dfvs_core.arrays import Float32Array, ImageArray
from dfvs_core.errors import ModelError
from dfvs_models.bundle import Bundle
from dfvs_models.encode_match import COUNT_AXIS
from dfvs_models.onnx_session import Execution, OnnxGraph
from dfvs_models.pair import pair_tensors, picture_tensor


class BundleRunner:
    """Runs an ``encode-match`` or ``pair`` bundle, and judges nothing.

    Raises
    ------
    ModelError
        If the bundle gives depth, or its graphs cannot be loaded.
    """

    def __init__(self, bundle: Bundle, threads: int = 2) -> None:
        manifest = bundle.manifest
        if manifest.kind == "mono":
            raise ModelError(f"bundle {manifest.name!r} gives depth", "a bundle that matches")
        self.bundle = bundle
        self._graphs = {
            role: OnnxGraph(
                bundle.graph(role),
                graph.file,
                Execution(threads),
                COUNT_AXIS if role == "match" else None,
            )
            for role, graph in manifest.graphs.items()
        }

    def tensor(self, image: ImageArray) -> Float32Array:
        """Image (H, W, 3) uint8 RGB to (1, C, h, w), as the manifest says."""
        return picture_tensor(image, self.bundle.manifest.input)

    def encode(self, image: ImageArray) -> list[Float32Array]:
        """Keypoints of an image; for a ``pair`` bundle, the image's tensor."""
        tensor = self.tensor(image)
        if self.bundle.manifest.kind == "pair":
            return [tensor]
        outputs = self.bundle.manifest.graphs["encode"].outputs
        return self._graphs["encode"].run([tensor], outputs)

    def match(self, first: list[Float32Array], second: list[Float32Array]) -> list[Float32Array]:
        """Outputs of the last graph, from what ``encode`` gave of two images."""
        role = "pair" if self.bundle.manifest.kind == "pair" else "match"
        outputs = self.bundle.manifest.graphs[role].outputs
        return self._graphs[role].run(list(self.feeds(first, second).values()), outputs)

    def feeds(
        self, first: list[Float32Array], second: list[Float32Array]
    ) -> Mapping[str, Float32Array]:
        """Name what goes into the last graph, from what ``encode`` gave of two images."""
        manifest = self.bundle.manifest
        if manifest.kind == "encode-match":
            return manifest.match_feeds(first, second)
        tensors = pair_tensors(first[0], second[0], manifest.input)
        return dict(zip(manifest.graphs["pair"].inputs, tensors, strict=True))
