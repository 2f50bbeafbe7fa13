"""Running a bundle with ONNX Runtime, as the checks and measurements of this room need it."""

from __future__ import annotations

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from dfvs_core.correspondence import FlowField
from dfvs_core.errors import ModelError
from dfvs_core.manifest import Manifest

Tensors = dict[str, NDArray[np.float32]]


class FlowRunner:
    """Runs an ``encode-match`` or ``pair`` bundle on pictures of exactly its input size."""

    def __init__(self, manifest: Manifest, contents: dict[str, bytes], threads: int = 2) -> None:
        if manifest.kind == "mono":
            raise ModelError(f"bundle {manifest.name!r} gives depth", "a bundle that gives flow")
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        options.log_severity_level = 3
        self.manifest = manifest
        self.sessions = {
            role: onnxruntime.InferenceSession(
                contents[graph.file], options, providers=["CPUExecutionProvider"]
            )
            for role, graph in manifest.graphs.items()
        }

    def tensor(self, image: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Picture (H, W, 3) uint8 RGB to (1, C, H, W), normalised as the manifest says.

        Raises
        ------
        ModelError
            If the picture has another size than the bundle's input.
        """
        spec = self.manifest.input
        if image.shape != (spec.height, spec.width, 3):
            raise ModelError(f"picture of shape {image.shape}", f"{(spec.height, spec.width, 3)}")
        if spec.channels == "grey":
            image = np.asarray(image @ np.array([0.299, 0.587, 0.114]))[..., None]
        elif spec.channels == "bgr":
            image = image[..., ::-1]
        scaled = image.astype(np.float32) * spec.scale - np.array(spec.mean, dtype=np.float32)
        planes = (scaled / np.array(spec.std, dtype=np.float32)).transpose(2, 0, 1)[None]
        return np.ascontiguousarray(planes, dtype=np.float32)

    def encode(self, image: NDArray[np.uint8]) -> list[NDArray[np.float32]]:
        """Features of a picture; for a ``pair`` bundle, the picture's tensor."""
        if self.manifest.kind == "pair":
            return [self.tensor(image)]
        graph = self.manifest.graphs["encode"]
        feeds = {graph.inputs[0]: self.tensor(image)}
        return list(self.sessions["encode"].run(list(graph.outputs), feeds))

    def match(
        self, first: list[NDArray[np.float32]], second: list[NDArray[np.float32]]
    ) -> FlowField:
        """Flow from the first picture to the second, from what ``encode`` gave."""
        if self.manifest.kind == "pair":
            return self._pair(first[0], second[0])
        graph = self.manifest.graphs["match"]
        feeds = self.manifest.match_feeds(first, second)
        flow, confidence = self.sessions["match"].run(list(graph.outputs), feeds)
        return FlowField(np.ascontiguousarray(flow[0].transpose(1, 2, 0)), confidence[0, 0])

    def _pair(self, first: NDArray[np.float32], second: NDArray[np.float32]) -> FlowField:
        graph = self.manifest.graphs["pair"]
        layout = self.manifest.input.layout
        if layout == "separate":
            tensors = [first, second]
        else:
            join = np.concatenate if layout == "channels" else np.stack
            tensors = [join([first, second], axis=1)]
        feeds = dict(zip(graph.inputs, tensors, strict=True))
        (flow,) = self.sessions["pair"].run(list(graph.outputs), feeds)
        output = self.manifest.flow
        if output is None or output.stride != 1:
            raise ModelError(f"bundle {self.manifest.name!r} gives coarse flow", "stride 1")
        vectors = output.scale * flow[0].transpose(1, 2, 0)
        if output.order == "vu":
            vectors = vectors[..., ::-1]
        field = np.ascontiguousarray(vectors, dtype=np.float32)
        return FlowField(field, np.ones(field.shape[:2], dtype=np.float32))
