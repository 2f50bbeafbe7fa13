"""The classical matcher, with a network to ask where it is at a loss.

Features and dense inverse search are the more precise where they hold, and know when they do not:
plain walls, repetition, large turns. Only then the network is run. Its flow is refined like any
other start; the surer of the two results is taken, and the network's own flow where neither is
sure of anything.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from dfvs_core.arrays import ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.errors import ImageError
from dfvs_core.matching.classical import ClassicalMatcher, refit, sure_share
from dfvs_core.matching.matcher import Matcher, Prepared, check_same_size
from dfvs_core.matching.trust import returns, stays_inside

_AT_LOSS_SHARE = 0.35
"""Share of sure pixels under which the network is asked."""
_BETTER = 1.2
"""How much surer the refined network flow must be than the classical result."""
_NOTHING_SHARE = 0.06
"""Share of sure pixels under which a result is as good as none."""
_UNCONFIRMED = 0.5
"""Factor on the confidence of a network's flow that no refinement has confirmed."""


class HybridPicture(Prepared):
    """A picture prepared for both; for the network, when it is first asked for."""

    def __init__(self, image: ImageArray, classical: ClassicalMatcher, network: Matcher) -> None:
        self.classical = classical.prepare(image)
        super().__init__(self.classical.size)
        self._image, self._network = image, network

    @cached_property
    def features(self) -> Prepared:
        """The network's features."""
        return self._network.prepare(self._image)


class HybridMatcher:
    """Dense correspondences, classical where that holds; see the module's text.

    Parameters
    ----------
    network : Matcher
        What to ask where the classical matcher is at a loss.
    """

    def __init__(self, network: Matcher) -> None:
        self._classical = ClassicalMatcher()
        self._network = network

    def prepare(self, image: ImageArray) -> HybridPicture:
        """Take a picture (H, W, 3) uint8 RGB."""
        return HybridPicture(image, self._classical, self._network)

    def match(
        self, current: Prepared, other: Prepared, guess: FlowField | None = None
    ) -> FlowField:
        """Flow from ``current`` to ``other``; see :class:`Matcher`."""
        current, other = _check_pair(current, other)
        field = self._classical.match(current.classical, other.classical, guess)
        share = sure_share(field)
        if share >= _AT_LOSS_SHARE:
            return field
        coarse = self._ask(current, other)
        refined = refit(current.classical, other.classical, coarse)
        if refined is not None and sure_share(refined) > _BETTER * share:
            field, share = refined, sure_share(refined)
        if share >= _NOTHING_SHARE:
            return field
        return FlowField(coarse.flow, np.float32(_UNCONFIRMED) * coarse.confidence)

    def track(self, current: Prepared, other: Prepared, guess: FlowField) -> FlowField | None:
        """Flow by a good guess alone, without the network; see :class:`Matcher`."""
        current, other = _check_pair(current, other)
        return self._classical.track(current.classical, other.classical, guess)

    def _ask(self, current: HybridPicture, other: HybridPicture) -> FlowField:
        """Flow of the network; it is as sure as it says where it also finds the way back."""
        there = self._network.match(current.features, other.features)
        back = self._network.match(other.features, current.features)
        agrees = returns(there.flow, back.flow) * stays_inside(there.flow)
        return FlowField(there.flow, there.confidence * agrees)


def _check_pair(current: Prepared, other: Prepared) -> tuple[HybridPicture, HybridPicture]:
    """Refuse pictures of different sizes or of another matcher."""
    check_same_size(current, other)
    if not (isinstance(current, HybridPicture) and isinstance(other, HybridPicture)):
        raise ImageError("pictures were prepared by another matcher", "the same matcher's")
    return current, other
