"""Running a bundle's graphs once, with the service's own adapters, to check and to time them."""

from __future__ import annotations

import numpy as np

from dfvs_core.arrays import Float32Array, ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.errors import ModelError
from dfvs_core.manifest import FlowOutput
from dfvs_models.bundle import Bundle
from dfvs_models.onnx_session import Execution, OnnxGraph
from dfvs_models.pair import pair_tensors, picture_flow, picture_tensor


class FlowRunner:
    """Runs an ``encode-match`` or ``pair`` bundle on pictures of exactly its input size.

    Unlike the service's matchers it runs a ``pair`` network one way only and judges nothing.
    """

    def __init__(self, bundle: Bundle, threads: int = 2) -> None:
        if bundle.manifest.flow is None:
            raise ModelError(
                f"bundle {bundle.manifest.name!r} gives depth", "a bundle that gives flow"
            )
        self.bundle = bundle
        self._flow: FlowOutput = bundle.manifest.flow
        self._graphs = {
            role: OnnxGraph(bundle.graph(role), graph.file, Execution(threads))
            for role, graph in bundle.manifest.graphs.items()
        }

    def tensor(self, image: ImageArray) -> Float32Array:
        """Picture (H, W, 3) uint8 RGB to (1, C, H, W), normalised as the manifest says.

        Raises
        ------
        ModelError
            If the picture has another size than the bundle's input.
        """
        spec = self.bundle.manifest.input
        if image.shape != (spec.height, spec.width, 3):
            raise ModelError(f"picture of shape {image.shape}", f"{(spec.height, spec.width, 3)}")
        return picture_tensor(image, spec)

    def encode(self, image: ImageArray) -> list[Float32Array]:
        """Features of a picture; for a ``pair`` bundle, the picture's tensor."""
        if self.bundle.manifest.kind == "pair":
            return [self.tensor(image)]
        outputs = self.bundle.manifest.graphs["encode"].outputs
        return self._graphs["encode"].run([self.tensor(image)], outputs)

    def match(self, first: list[Float32Array], second: list[Float32Array]) -> FlowField:
        """Flow from the first picture to the second, from what ``encode`` gave."""
        manifest = self.bundle.manifest
        role = "pair" if manifest.kind == "pair" else "match"
        if role == "pair":
            feeds = self.pair_feeds(first[0], second[0])
        else:
            feeds = manifest.match_feeds(first, second)
        raw, *sureness = self._graphs[role].run(list(feeds.values()), manifest.graphs[role].outputs)
        size = (manifest.input.height, manifest.input.width)
        flow = picture_flow(raw, manifest.input, self._flow, size)
        return FlowField(flow, sureness[0][0, 0] if sureness else np.ones(size, np.float32))

    def pair_feeds(self, first: Float32Array, second: Float32Array) -> dict[str, Float32Array]:
        """Name what goes into the graph ``pair``, from the tensors of both pictures."""
        names = self.bundle.manifest.graphs["pair"].inputs
        tensors = pair_tensors(first, second, self.bundle.manifest.input)
        return dict(zip(names, tensors, strict=True))
