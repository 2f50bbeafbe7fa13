"""Interface of the matchers."""

from collections.abc import Sequence
from typing import Protocol, TypeVar

from dfvs_core.errors import ImageError
from dfvs_core.geometry.arrays import ImageArray, check_image
from dfvs_core.matching.correspondence import FlowField

LEAST_SIZE_PX = 32
"""Width and height of the smallest images that can be matched."""


class ImageFeatures:
    """An image as its matcher wants it, opaque to everybody else.

    Parameters
    ----------
    size : tuple of int
        Working size (height, width), px: of the flow fields.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self.size = size

    def prepare(self) -> None:
        """Compute now what only sparse matches ask for."""

    def release(self) -> None:
        """Release it; it is computed anew where it is asked for, to the bit."""


OwnFeatures = TypeVar("OwnFeatures", bound=ImageFeatures)


class Matcher(Protocol):
    """Finds where the points of one image are seen in another.

    A matcher keeps nothing between calls: the same arguments give the same bits.
    """

    def encode(self, image: ImageArray) -> ImageFeatures:
        """Compute once what depends on one image (H, W, 3) alone."""
        ...

    def match(
        self, current: ImageFeatures, other: ImageFeatures, *, excluded: Sequence[FlowField] = ()
    ) -> FlowField:
        """Flow from ``current`` to ``other``, without a prior.

        Parameters
        ----------
        current, other : ImageFeatures
            Two images of equal size, encoded by this same matcher.
        excluded : sequence of FlowField
            Flows of hypotheses that were rejected. What leads to the same places does not count;
            where nothing else is found the flow comes without any confidence.

        Returns
        -------
        FlowField
            (H, W), ``current.size``: the working size, which may be smaller than the image.
        """
        ...

    def track(
        self, current: ImageFeatures, other: ImageFeatures, predicted: FlowField
    ) -> FlowField | None:
        """Flow by a prediction alone; None where it does not hold."""
        ...

    def extend(
        self, current: ImageFeatures, other: ImageFeatures, known: FlowField
    ) -> FlowField | None:
        """Flow by one that is known to hold somewhere, and by what else matches with it.

        It may hold in more of the image, or in less. It takes little longer than :meth:`track`.
        None where nothing else is found.
        """
        ...


def track_or_match(
    matcher: Matcher, current: ImageFeatures, other: ImageFeatures, predicted: FlowField | None
) -> FlowField:
    """Flow by a prediction where it holds, else without a prior."""
    tracked = None if predicted is None else matcher.track(current, other, predicted)
    return matcher.match(current, other) if tracked is None else tracked


def working_size(image: ImageArray, most_width_px: int | None = None) -> tuple[int, int]:
    """Size (height, width) at which an image is matched: its own, reduced to a largest width.

    Raises
    ------
    ImageError
        If the image is not (H, W, 3) uint8, or height or width are under ``LEAST_SIZE_PX``.
    """
    check_image(image)
    height, width = image.shape[:2]
    scale = 1.0 if most_width_px is None else min(1.0, most_width_px / width)
    size = round(height * scale), round(width * scale)
    if min(size) < LEAST_SIZE_PX:
        raise ImageError(
            f"image has {size[1]} x {size[0]} px where it is matched",
            f"{LEAST_SIZE_PX} x {LEAST_SIZE_PX} or more",
        )
    return size


def check_pair(
    current: ImageFeatures, other: ImageFeatures, kind: type[OwnFeatures]
) -> tuple[OwnFeatures, OwnFeatures]:
    """Both images, as a matcher's own kind.

    Raises
    ------
    ImageError
        If their sizes differ, or another matcher encoded one of them.
    """
    if current.size != other.size:
        (h, w), (oh, ow) = current.size, other.size
        raise ImageError(
            f"images of {w} x {h} and {ow} x {oh} px cannot be matched", "one size for both"
        )
    if not (isinstance(current, kind) and isinstance(other, kind)):
        raise ImageError("images were prepared by another matcher", "the same matcher's")
    return current, other
