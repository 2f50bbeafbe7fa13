"""Sparse matches from an ``encode-match`` bundle."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import cast

import cv2
import numpy as np

from dfvs_core.errors import ModelError
from dfvs_core.geometry.arrays import BoolArray, Float32Array, FloatArray, ImageArray
from dfvs_core.matching.points import NO_MATCHES, Exclusion, PointMatches
from dfvs_core.messages.network_tensors import ImageInput
from dfvs_models.bundle import Bundle
from dfvs_models.onnx_session import Execution, OnnxGraph, trial_image

FREE_AXES = (0, 1)
"""Axes of the match graph's inputs of any size: pairs of images, of which one is matched at a time,
and keypoints."""
_FEW_KEYPOINTS = 400
"""Keypoints that are matched at a known turn and scale."""
_RANKING_KEYPOINTS = 256
"""Keypoints by which turns and scales are ranked."""
_CLEAR_SUPPORT = 20.0
"""Sum of the confidence of their matches at which no others are tried."""
_COSINE_POWER = 8
"""Power of the cosine of two descriptors that makes likely matches count."""
_OUTSIDE = -1e4
"""Value of a pixel outside of the image, so low that an interpolated one is negative too."""


def found_keypoints(encoded: list[Float32Array]) -> list[Float32Array]:
    """Outputs of the ``encode`` graph without the rows of score 0, which are no keypoints."""
    is_found = encoded[-1][0] > 0
    return [tensor[:, is_found] for tensor in encoded]


class Keypoints:
    """Outputs of the ``encode`` graph, and the map (2, 3) from the network's px to the image's."""

    def __init__(self, tensors: list[Float32Array], to_image: FloatArray) -> None:
        self.tensors = tensors
        self._to_image = to_image

    def __len__(self) -> int:
        return int(self.tensors[0].shape[1])

    def in_image(self, points: Float32Array) -> Float32Array:
        """Points (N, 2) of the network's image in px of the image."""
        moved = points @ self._to_image[:, :2].T + self._to_image[:, 2]
        return np.asarray(moved, np.float32)

    def strongest(self, count: int) -> Keypoints:
        """The keypoints of the highest scores."""
        return Keypoints([tensor[:, :count] for tensor in self.tensors], self._to_image)

    def similarity(self, other: Keypoints) -> float:
        """Sum over those that are each other's nearest by their descriptors' cosine."""
        if not (len(self) and len(other)):
            return 0.0
        first, second = (
            tensors[1][0] / np.linalg.norm(tensors[1][0], axis=1, keepdims=True)
            for tensors in (self.tensors, other.tensors)
        )
        cosine = first @ second.T
        nearest, own = cosine.argmax(axis=1), np.arange(len(cosine))
        mutual = own[cosine.argmax(axis=0)[nearest] == own]
        return float(np.sum(cosine[mutual, nearest[mutual]] ** _COSINE_POWER))

    def without(self, points: Float32Array) -> Keypoints:
        """Keypoints that are at none of some points (N, 2) px of the image."""
        gone = {tuple(point) for point in points.tolist()}
        at = self.in_image(self.tensors[0][0]).tolist()
        kept = [k for k, point in enumerate(at) if tuple(point) not in gone]
        return Keypoints([tensor[:, kept] for tensor in self.tensors], self._to_image)


class EncodedImage:
    """Keypoints of an image; those of it turned and reduced when they are first asked for."""

    def __init__(self, image: ImageArray, network: EncodeMatchPoints) -> None:
        self._grey = cast(ImageArray, cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))
        self._network = network
        self._found: dict[tuple[float, float], Keypoints] = {}
        self.keypoints()

    def keypoints(self, angle_rad: float = 0.0, scale: float = 1.0) -> Keypoints:
        """Keypoints of the image turned counter-clockwise about its middle, and reduced."""
        wanted = (angle_rad, scale)
        if wanted not in self._found:
            self._found[wanted] = self._network.keypoints(self._grey, angle_rad, scale)
        return self._found[wanted]


class EncodeMatchPoints:
    """Runs an ``encode-match`` bundle.

    Parameters
    ----------
    bundle : Bundle
    execution : Execution
    turns_rad, scales : tuple of float
        Angles by which the other image is turned, and factors by which it is reduced: a hypothesis
        for each pair of them.

    Raises
    ------
    ModelError
        If the graphs' tensors are not what the manifest says, or do not fit each other, or the
        output is not finite.
    """

    def __init__(
        self,
        bundle: Bundle,
        execution: Execution,
        turns_rad: tuple[float, ...] = (0.0,),
        scales: tuple[float, ...] = (1.0,),
    ) -> None:
        manifest = bundle.manifest
        if manifest.kind != "encode-match":
            raise ModelError(f"bundle {manifest.name!r} is {manifest.kind!r}", "'encode-match'")
        self._manifest = manifest
        self._input: ImageInput = manifest.input
        self.width_px = manifest.input.width
        """Of the network's images."""
        self._turns_rad, self._scales = turns_rad, scales
        self._changes = tuple(itertools.product(turns_rad, scales))
        self._encode = OnnxGraph(bundle, "encode", execution)
        self._match = OnnxGraph(bundle, "match", execution, FREE_AXES)
        self._check_tensors()
        self._try_out()

    def encode(self, image: ImageArray) -> EncodedImage:
        """Take an image (H, W, 3) uint8 RGB."""
        return EncodedImage(image, self)

    def hypotheses(
        self, current: EncodedImage, other: EncodedImage, exclusion: Exclusion | None = None
    ) -> Iterator[PointMatches]:
        """Matches with the other image, turned and reduced; see ``dfvs_core.matching.points``.

        The strongest keypoints are matched first, to rank the changes; all of them are when a
        hypothesis is asked for. Points with an unwanted match are left out, and the others
        matched once more. Output that is not finite gives no match.
        """
        first = current.keypoints()
        for second in self._ranked(first, [other.keypoints(*change) for change in self._changes]):
            found = self._match_points(first, second)
            if exclusion is not None and (wrong := exclusion(found)).any():
                found = self._match_points(first.without(found.current[wrong]), second)
            yield found

    def expected(
        self, current: EncodedImage, other: EncodedImage, turn_rad: float, scale: float
    ) -> PointMatches:
        """Matches of the strongest keypoints at the nearest change; as :meth:`hypotheses`."""
        turn = min(self._turns_rad, key=lambda turn: abs(math.remainder(turn - turn_rad, math.tau)))
        reduced = min(self._scales, key=lambda reduced: abs(math.log(reduced * scale)))
        first, second = current.keypoints(), other.keypoints(turn, reduced)
        return self._match_points(*(every.strongest(_FEW_KEYPOINTS) for every in (first, second)))

    def _ranked(self, first: Keypoints, changed: list[Keypoints]) -> list[Keypoints]:
        """Other keypoints by the support of a match of the strongest.

        The likeliest by their descriptors are matched first, up to one with clear support.
        """
        few = first.strongest(_RANKING_KEYPOINTS)
        others = [second.strongest(_RANKING_KEYPOINTS) for second in changed]
        likely = sorted(range(len(changed)), key=lambda k: -few.similarity(others[k]))
        support = dict.fromkeys(likely, 0.0)
        for k in likely if len(likely) > 1 else ():
            support[k] = float(self._match_points(few, others[k]).confidence.sum())
            if support[k] >= _CLEAR_SUPPORT:
                break
        return [changed[k] for k in sorted(likely, key=lambda k: -support[k])]

    def _match_points(self, first: Keypoints, second: Keypoints) -> PointMatches:
        if not (len(first) and len(second)):
            return NO_MATCHES
        feeds = self._manifest.match_feeds(first.tensors, second.tensors)
        points, confidence = (found[0] for found in self._match.run(list(feeds.values())))
        confidence = np.nan_to_num(confidence, posinf=0.0)
        at = first.tensors[0][0]
        kept: BoolArray = confidence > 0.0
        kept &= np.isfinite(at).all(axis=1) & np.isfinite(points).all(axis=1)
        to = second.in_image(points[kept])
        return PointMatches(first.in_image(at[kept]), to, confidence[kept])

    def keypoints(self, grey: ImageArray, angle_rad: float, scale: float) -> Keypoints:
        """Keypoints of a grey image (h, w), fitted into the network's, then reduced and turned."""
        height, width = grey.shape
        scale = scale * min(self._input.width / width, self._input.height / height)
        if scale != 1.0:
            method = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_LINEAR
            fitted = (round(width * scale), round(height * scale))
            grey = cast(ImageArray, cv2.resize(grey, fitted, interpolation=method))
        size = (self._input.width, self._input.height)
        c, s = math.cos(angle_rad), math.sin(angle_rad)
        turn = np.array([[c, s], [-s, c]])
        middle = 0.5 * (np.array(grey.shape[::-1]) - 1.0)
        shift = 0.5 * (np.array(size) - 1.0) - turn @ middle
        warped = cv2.warpAffine(
            grey.astype(np.float32),
            np.column_stack([turn, shift]),
            size,
            flags=cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=_OUTSIDE,
        )
        canvas = np.asarray(warped, np.float32)
        tensors = found_keypoints(self._encode.run([canvas[None, None]]))
        # to the image: back by the turn, then from its scaled pixels to its own
        linear = turn.T / scale
        return Keypoints(tensors, np.column_stack([linear, (0.5 - turn.T @ shift) / scale - 0.5]))

    def _check_tensors(self) -> None:
        """Check names, and that images and keypoints have the shapes that they have to have."""
        for graph, outputs in ((self._encode, 3), (self._match, 2)):
            graph.require_inputs()
            graph.require_outputs()
            said = graph.said
            if len(said.outputs) != outputs:
                raise ModelError(
                    f"{said.file!r} has the outputs {said.outputs}", f"{outputs} of them"
                )
        shape = (1, 1, self._input.height, self._input.width)
        actual = [(spec.element, spec.shape) for spec in self._encode.inputs]
        if actual != [("tensor(float)", shape)]:
            raise ModelError(f"graph 'encode' takes {actual}", f"tensor(float) of {shape}")

    def _try_out(self) -> None:
        """Run both: shapes that lie and weights that are not finite show up.

        With the fewest keypoints and the most: TensorRT's engine is for the sizes that it has seen.
        """
        trial = trial_image(self._input.width, self._input.height)
        encoded = self.keypoints(trial, 0.0, 1.0).tensors
        if not (count := encoded[0].shape[1]):
            raise ModelError(
                "graph 'encode' finds no keypoint in a ramp of all greys",
                "scores above 0",
                "its weights are damaged",
            )
        for few in (1, count):
            self._try_match([tensor[:, :few] for tensor in encoded])

    def _try_match(self, tensors: list[Float32Array]) -> None:
        feeds = self._manifest.match_feeds(tensors, tensors)
        given = [(0, *tensor.shape[2:]) for tensor in feeds.values()]
        expected = [spec.shape[1:] for spec in self._match.inputs]
        if given != expected:
            raise ModelError(
                f"graph 'match' takes {expected} of a pair of images",
                f"what 'encode' gives, of any number of keypoints (0): {given}",
            )
        shape = tensors[0].shape[:2]
        outputs = self._match.run(list(feeds.values()))
        self._match.require_values(outputs, [(*shape, 2), shape], "finite points and confidence")
