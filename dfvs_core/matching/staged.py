"""Staged matcher: tracking from a predicted flow, or relocalisation."""

from collections.abc import Iterator, Sequence
from typing import Generic, cast

import cv2
import numpy as np

from dfvs_core.geometry.arrays import BoolArray, Float32Array, ImageArray
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import FlowField, empty_flow, exclude
from dfvs_core.matching.matcher import ImageFeatures, check_pair, working_size
from dfvs_core.matching.points import Features, PointMatcher, PointMatches, is_excluded
from dfvs_core.matching.relocalise import relocalise
from dfvs_core.matching.track import extend, track
from dfvs_core.matching.warping import resized


class StagedImage(ImageFeatures, Generic[Features]):
    """Image at the working size in grey (H, W), and its features, encoded when first asked for."""

    def __init__(
        self, image: ImageArray, points: PointMatcher[Features], config: MatchingConfig
    ) -> None:
        features_size = working_size(image, points.width_px)
        super().__init__(config.working_size((image.shape[0], image.shape[1])))
        self._image = resized(image, features_size)
        self._points = points
        self._features: Features | None = None
        enlarges = self.size[1] > features_size[1]
        shown = image if enlarges else self._image
        grey = cast(ImageArray, cv2.cvtColor(shown, cv2.COLOR_RGB2GRAY))
        self.grey = resized(grey, self.size)

    @property
    def features(self) -> Features:
        """Features of the point matcher; another thread may ask for them at the same time."""
        features = self._features
        if features is None:
            self._features = features = self._points.encode(self._image)
        return features

    def at_working_size(self, points: Float32Array) -> Float32Array:
        """Points (N, 2) px of the image that features lie in, in px of the working size."""
        scale = self.size[1] / self._image.shape[1]
        return np.asarray((points + 0.5) * scale - 0.5, np.float32)

    def prepare(self) -> None:
        """Encode the features."""
        _ = self.features

    def release(self) -> None:
        """Release the features; they are encoded anew where they are asked for again."""
        self._features = None


class StagedMatcher(Generic[Features]):
    """Dense correspondences by the stages of this package.

    Parameters
    ----------
    points : PointMatcher
        Source of sparse matches for relocalisation.
    config : MatchingConfig
    """

    def __init__(
        self, points: PointMatcher[Features], config: MatchingConfig | None = None
    ) -> None:
        self._points = points
        self._config = config or MatchingConfig()

    def encode(self, image: ImageArray) -> StagedImage[Features]:
        """Take an image (H, W, 3) uint8 RGB."""
        return StagedImage(image, self._points, self._config)

    def match(
        self, current: ImageFeatures, other: ImageFeatures, *, excluded: Sequence[FlowField] = ()
    ) -> FlowField:
        """Flow without a prior; see :class:`Matcher`."""
        first, second = check_pair(current, other, StagedImage)
        hypotheses = self._hypotheses(first, second, excluded)
        found = relocalise(first.grey, second.grey, hypotheses, self._config)
        return empty_flow(first.size) if found is None else exclude(found, excluded, self._config)

    def track(
        self, current: ImageFeatures, other: ImageFeatures, predicted: FlowField
    ) -> FlowField | None:
        """Flow by a prediction alone; see :class:`Matcher`."""
        first, second = check_pair(current, other, StagedImage)
        return track(first.grey, second.grey, predicted, self._config)

    def extend(
        self, current: ImageFeatures, other: ImageFeatures, known: FlowField
    ) -> FlowField | None:
        """Flow by a known one and by sparse matches; see :class:`Matcher`."""
        first, second = check_pair(current, other, StagedImage)

        def expected(turn_rad: float, scale: float) -> PointMatches:
            found = self._points.expected(first.features, second.features, turn_rad, scale)
            return _at_working_size(first, second, found)

        return extend(first.grey, second.grey, known, expected, self._config)

    def _hypotheses(
        self,
        current: StagedImage[Features],
        other: StagedImage[Features],
        excluded: Sequence[FlowField],
    ) -> Iterator[PointMatches]:
        """Hypotheses in px of the working size, without matches that follow an excluded flow."""

        def exclusion(found: PointMatches) -> BoolArray:
            return is_excluded(_at_working_size(current, other, found), excluded, self._config)

        for matches in self._points.hypotheses(current.features, other.features, exclusion):
            yield _at_working_size(current, other, matches.select(~exclusion(matches)))


def _at_working_size(
    current: StagedImage[Features], other: StagedImage[Features], found: PointMatches
) -> PointMatches:
    """Matches in px of the images that features lie in, in px of the working size."""
    at, to = current.at_working_size(found.current), other.at_working_size(found.other)
    return PointMatches(at, to, found.confidence)
