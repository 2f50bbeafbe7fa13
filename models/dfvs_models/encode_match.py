"""A network of two graphs as a matcher: a picture is encoded once, however often it is matched."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dfvs_core.arrays import Float32Array, ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.errors import ImageError, ModelError
from dfvs_core.manifest import FlowOutput, PictureInput
from dfvs_core.matching.matcher import Prepared, check_image, check_same_size
from dfvs_core.matching.merit import passing_over
from dfvs_models.bundle import Bundle
from dfvs_models.onnx_session import Execution, OnnxGraph
from dfvs_models.pair import picture_flow, picture_map, picture_tensor

_ENCODE, _MATCH = "encode", "match"


class EncodedPicture(Prepared):
    """A picture's features, in the order of the ``encode`` graph's outputs."""

    def __init__(self, size: tuple[int, int], features: list[Float32Array]) -> None:
        super().__init__(size)
        self.features = features


class EncodeMatchMatcher:
    """Runs an ``encode-match`` bundle: features of pictures, then flow and confidence.

    A guess is not used.

    Raises
    ------
    ModelError
        If the graphs' tensors are not what the manifest says, or do not fit each other, or the
        output is not finite.
    """

    def __init__(self, bundle: Bundle, execution: Execution) -> None:
        manifest = bundle.manifest
        if manifest.kind != "encode-match" or manifest.flow is None:
            raise ModelError(f"bundle {manifest.name!r} is {manifest.kind!r}", "'encode-match'")
        self._manifest = manifest
        self._input: PictureInput = manifest.input
        self._flow: FlowOutput = manifest.flow
        self._roles = manifest.graphs
        self._encode, self._match = (
            OnnxGraph(bundle.graph(role), manifest.graphs[role].file, execution)
            for role in (_ENCODE, _MATCH)
        )
        self._check_tensors()
        self._try_out()

    def prepare(self, image: ImageArray) -> EncodedPicture:
        """Encode a picture (H, W, 3) uint8 RGB."""
        check_image(image)
        tensor = picture_tensor(image, self._input)
        features = self._encode.run([tensor], self._roles[_ENCODE].outputs)
        return EncodedPicture((image.shape[0], image.shape[1]), features)

    def match(
        self,
        current: Prepared,
        other: Prepared,
        guess: FlowField | None = None,
        *,
        besides: Sequence[FlowField] = (),
    ) -> FlowField:
        """Flow from ``current`` to ``other``; see ``dfvs_core.matching.matcher.Matcher``.

        Output that is not finite gives a field of zeros without confidence. A network finds what it
        finds: if that is to be passed over there is nothing.
        """
        check_same_size(current, other)
        if not (isinstance(current, EncodedPicture) and isinstance(other, EncodedPicture)):
            raise ImageError("pictures were prepared by another matcher", "the same matcher's")
        raw, sureness = self._run(current, other)
        if not (np.isfinite(raw).all() and np.isfinite(sureness).all()):
            nothing = np.zeros((*current.size, 2), np.float32)
            return FlowField(nothing, np.zeros(current.size, np.float32))
        flow = picture_flow(raw, self._input, self._flow, current.size)
        confidence = picture_map(sureness[0, 0], current.size)
        field = FlowField(flow, np.clip(confidence, 0.0, 1.0))
        return passing_over(field, besides)

    def track(self, current: Prepared, other: Prepared, guess: FlowField) -> FlowField | None:
        """Flow of the network, which takes as long with a guess as without."""
        return self.match(current, other, guess)

    def _run(self, current: EncodedPicture, other: EncodedPicture) -> list[Float32Array]:
        return self._match.run(self._both(current, other), self._roles[_MATCH].outputs)

    def _both(self, current: EncodedPicture, other: EncodedPicture) -> list[Float32Array]:
        """Features of both pictures in the order of the ``match`` graph's inputs."""
        return list(self._manifest.match_feeds(current.features, other.features).values())

    def _check_tensors(self) -> None:
        """Check names, and that pictures and features have the shapes that they have to have."""
        for role, graph in ((_ENCODE, self._encode), (_MATCH, self._match)):
            names = [spec.name for spec in graph.inputs]
            said = self._roles[role]
            if names != list(said.inputs):
                raise ModelError(f"{said.file!r} has the inputs {names}", f"{list(said.inputs)}")
            missing = set(said.outputs) - set(graph.output_names)
            if missing:
                raise ModelError(f"{said.file!r} lacks the outputs {sorted(missing)}")
        if len(self._roles[_MATCH].outputs) != 2:
            raise ModelError(
                f"graph 'match' has the outputs {self._roles[_MATCH].outputs}",
                "flow and confidence",
            )
        shape = (1, self._input.channel_count, self._input.height, self._input.width)
        actual = [(spec.element, spec.shape) for spec in self._encode.inputs]
        if actual != [("tensor(float)", shape)]:
            raise ModelError(f"graph 'encode' takes {actual}", f"tensor(float) of {shape}")

    def _try_out(self) -> None:
        """Run both once: shapes that lie and weights that are not finite show up."""
        height, width = self._input.height, self._input.width
        ramp = np.add.outer(np.arange(height), np.arange(width)) % 256
        picture = self.prepare(np.repeat(ramp[..., None], 3, axis=2).astype(np.uint8))
        expected = [spec.shape for spec in self._match.inputs]
        given = [feature.shape for feature in self._both(picture, picture)]
        if given != expected:
            raise ModelError(f"graph 'match' takes {expected}", f"what 'encode' gives: {given}")
        raw, sureness = self._run(picture, picture)
        stride = self._flow.stride
        shape = (1, 2, height // stride, width // stride)
        if raw.shape != shape or sureness.shape[:2] != (1, 1) or sureness.ndim != 4:
            raise ModelError(
                f"graph 'match' gives {raw.shape} and {sureness.shape}", f"{shape} and (1, 1, h, w)"
            )
        if not (np.isfinite(raw).all() and np.isfinite(sureness).all()):
            raise ModelError(
                "graph 'match' gives values that are not finite",
                "finite flow and confidence",
                "its weights are damaged",
            )
