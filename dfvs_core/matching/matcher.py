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
        (height, width) of the picture in px.
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
        self,
        current: Prepared,
        other: Prepared,
        guess: FlowField | None = None,
        *,
        besides: Sequence[FlowField] = (),
    ) -> FlowField:
        """Flow from ``current`` to ``other`` on the grid of ``current``.

        Parameters
        ----------
        current, other : Prepared
            Two pictures of equal size, prepared by this same matcher.
        guess : FlowField, optional
            Flow of the previous frame to the same picture, which :meth:`track` did not find to
            hold as it is; see :func:`follow`. A matcher may use it to work faster and must not
            trust it: a wrong guess costs time, never correctness.
        besides : sequence of FlowField
            Flows that are known to be wrong. What leads to the same places is passed over; where
            nothing else is found the flow comes without any confidence.
        """
        ...

    def track(self, current: Prepared, other: Prepared, guess: FlowField) -> FlowField | None:
        """Flow by a good guess alone: never slower than that takes, None where it does not hold."""
        ...


def follow(
    matcher: Matcher, current: Prepared, other: Prepared, guess: FlowField | None
) -> FlowField:
    """Flow by a guess where that holds, and by a match where not."""
    tracked = None if guess is None else matcher.track(current, other, guess)
    return matcher.match(current, other, guess) if tracked is None else tracked


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
    if min(image.shape[:2]) < LEAST_SIZE_PX:
        size = f"{image.shape[1]} x {image.shape[0]} px"
        raise ImageError(f"picture has {size}", f"{LEAST_SIZE_PX} x {LEAST_SIZE_PX} or more")


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
