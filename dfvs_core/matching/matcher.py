"""What every source of dense correspondences offers to perception."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from dfvs_core.arrays import ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.errors import ImageError

LEAST_SIZE_PX = 32
"""Width and height of the smallest pictures that can be matched."""


class Prepared:
    """A picture as its matcher wants it: opaque to everybody else.

    Parameters
    ----------
    size : tuple of int
        Working size (height, width), px: of the flow fields.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self.size = size

    def slim(self) -> None:
        """Let go of what only a search asks for; where one does, it is found anew, to the bit."""


class Matcher(Protocol):
    """Finds where the points of one picture are seen in another.

    A matcher keeps nothing between calls: the same arguments give the same bits.
    """

    def prepare(self, image: ImageArray) -> Prepared:
        """Compute once what depends on one picture (H, W, 3) alone: a goal's, or a frame's."""
        ...

    def match(
        self, current: Prepared, other: Prepared, *, excluded: Sequence[FlowField] = ()
    ) -> FlowField:
        """Flow from ``current`` to ``other``, without a prior.

        Parameters
        ----------
        current, other : Prepared
            Two images of equal size, prepared by this same matcher.
        excluded : sequence of FlowField
            Flows of hypotheses that were rejected. What leads to the same places does not count;
            where nothing else is found the flow comes without any confidence.

        Returns
        -------
        FlowField
            (H, W), ``current.size``: the working size, which may be smaller than the image.
        """
        ...

    def track(self, current: Prepared, other: Prepared, predicted: FlowField) -> FlowField | None:
        """Flow by a prediction alone; None where it does not hold."""
        ...


def follow(
    matcher: Matcher, current: Prepared, other: Prepared, predicted: FlowField | None
) -> FlowField:
    """Flow by a prediction where it holds, else without a prior."""
    tracked = None if predicted is None else matcher.track(current, other, predicted)
    return matcher.match(current, other) if tracked is None else tracked


def check_image(image: ImageArray) -> None:
    """Refuse what is not an RGB picture that can be matched.

    Raises
    ------
    ImageError
        If it is not (H, W, 3) uint8 with H and W of ``LEAST_SIZE_PX`` or more.
    """
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype.name != "uint8":
        raise ImageError(
            f"picture is {image.dtype} of shape {image.shape}", "uint8 of (H, W, 3), RGB"
        )
    check_size((image.shape[0], image.shape[1]))


def check_size(size: tuple[int, int]) -> None:
    """Refuse a size (height, width) that is too small to be matched.

    Raises
    ------
    ImageError
        If one of them is under ``LEAST_SIZE_PX``.
    """
    if min(size) < LEAST_SIZE_PX:
        raise ImageError(
            f"image has {size[1]} x {size[0]} px where it is matched",
            f"{LEAST_SIZE_PX} x {LEAST_SIZE_PX} or more",
        )


def check_same_size(current: Prepared, other: Prepared) -> None:
    """Refuse two pictures of different sizes.

    Raises
    ------
    ImageError
        If their sizes differ.
    """
    if current.size != other.size:
        (h, w), (oh, ow) = current.size, other.size
        raise ImageError(
            f"pictures of {w} x {h} and {ow} x {oh} px cannot be matched", "one size for both"
        )
