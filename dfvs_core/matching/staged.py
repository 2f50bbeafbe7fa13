"""The matcher of the service: tracking where a prediction is at hand, else relocalisation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Generic, cast

import cv2
import numpy as np

from dfvs_core.arrays import ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.errors import ImageError
from dfvs_core.matching.confidence import empty_flow, exclude, is_excluded
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.matcher import Prepared, check_image, check_same_size, check_size
from dfvs_core.matching.points import Features, PointMatcher, PointMatches
from dfvs_core.matching.relocalise import relocalise
from dfvs_core.matching.track import track
from dfvs_core.matching.warping import resized


class StagedImage(Prepared, Generic[Features]):
    """Image at the working size in grey (H, W), and its features, encoded when first asked for."""

    def __init__(
        self, image: ImageArray, points: PointMatcher[Features], config: MatchingConfig
    ) -> None:
        check_image(image)
        super().__init__(config.working_size((image.shape[0], image.shape[1])))
        check_size(self.size)
        self._image = resized(image, _at_most(image, points.width_px))
        self._points = points
        self.scale = self.size[1] / self._image.shape[1]
        """Px of the working size in one of the image that features lie in."""
        grey = cast(ImageArray, cv2.cvtColor(self._image, cv2.COLOR_RGB2GRAY))
        self.grey = resized(grey, self.size)

    @cached_property
    def features(self) -> Features:
        """Features of the point matcher."""
        return self._points.encode(self._image)

    def slim(self) -> None:
        """Release the features; they are encoded anew where they are asked for again."""
        self.__dict__.pop("features", None)


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

    def prepare(self, image: ImageArray) -> StagedImage[Features]:
        """Take an image (H, W, 3) uint8 RGB."""
        return StagedImage(image, self._points, self._config)

    def match(
        self, current: Prepared, other: Prepared, *, excluded: Sequence[FlowField] = ()
    ) -> FlowField:
        """Flow without a prior; see :class:`Matcher`."""
        current, other = self._check(current, other)
        hypotheses = self._hypotheses(current, other, excluded)
        found = relocalise(current.grey, other.grey, hypotheses, self._config, excluded)
        return empty_flow(current.size) if found is None else exclude(found.field, excluded)

    def track(self, current: Prepared, other: Prepared, predicted: FlowField) -> FlowField | None:
        """Flow by a prediction alone; see :class:`Matcher`."""
        current, other = self._check(current, other)
        return track(current.grey, other.grey, predicted, self._config)

    def _hypotheses(
        self,
        current: StagedImage[Features],
        other: StagedImage[Features],
        excluded: Sequence[FlowField],
    ) -> Iterator[PointMatches]:
        """Hypotheses in px of the working size."""

        def scaled(found: PointMatches) -> PointMatches:
            at, to = (
                ((points + 0.5) * image.scale - 0.5).astype(np.float32)
                for points, image in ((found.current, current), (found.other, other))
            )
            return PointMatches(at, to, found.confidence)

        unwanted = (lambda found: is_excluded(scaled(found), excluded)) if excluded else None
        yield from map(scaled, self._points.hypotheses(current.features, other.features, unwanted))

    def _check(
        self, current: Prepared, other: Prepared
    ) -> tuple[StagedImage[Features], StagedImage[Features]]:
        """Refuse images of different sizes or of another matcher."""
        check_same_size(current, other)
        if not (isinstance(current, StagedImage) and isinstance(other, StagedImage)):
            raise ImageError("images were prepared by another matcher", "the same matcher's")
        return current, other


def _at_most(image: ImageArray, width_px: int) -> tuple[int, int]:
    """Size (height, width) of an image, reduced to a width if it has more."""
    height, width = image.shape[:2]
    scale = min(1.0, width_px / width)
    return round(height * scale), round(width * scale)
