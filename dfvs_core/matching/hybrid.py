"""A network that finds the way, and a classical matcher that makes it precise.

A network's flow is rarely wrong as a whole, but seldom good to a fraction of a pixel; dense
inverse search is the other way round. So the flow of the frame before, or the chance that little
moved, is tried first; where neither holds the network is run and its flow refined; where little
of that is sure, features are matched too. The surest result is taken, and the network's own flow
where none is sure of anything.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from dfvs_core.arrays import ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.errors import ImageError
from dfvs_core.matching.classical import (
    ClassicalMatcher,
    ClassicalPicture,
    bridge,
    match_near,
    refit,
    sure_share,
)
from dfvs_core.matching.matcher import Matcher, Prepared, check_same_size
from dfvs_core.matching.trust import returns, stays_inside

_ENOUGH_SHARE = 0.45
"""Share of sure pixels from which on a first match needs no features beside the network."""
_ENOUGH_IN_FLIGHT = 0.15
"""The same where the frame before was matched: a result late is worse than one less sure."""
_SETTLED_SHARE = 0.65
"""Share of sure pixels from which on nothing is refined a second time."""
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
    """Dense correspondences by a network, refined; see the module's text.

    Parameters
    ----------
    network : Matcher
        What to ask where little is known.
    judges : bool
        Whether the network says itself how far its flow can be trusted; where it does not, it is
        also asked for the way back.
    """

    def __init__(self, network: Matcher, judges: bool) -> None:
        self._classical = ClassicalMatcher()
        self._network = network
        self._judges = judges

    def prepare(self, image: ImageArray) -> HybridPicture:
        """Take a picture (H, W, 3) uint8 RGB."""
        return HybridPicture(image, self._classical, self._network)

    def match(
        self, current: Prepared, other: Prepared, guess: FlowField | None = None
    ) -> FlowField:
        """Flow from ``current`` to ``other``; see :class:`Matcher`."""
        current, other = _check_pair(current, other)
        near = match_near(current.classical, other.classical, guess)
        if near is not None:
            return near
        coarse = self._ask(current, other)
        field = _refine(current.classical, other.classical, coarse)
        if sure_share(field) >= (_ENOUGH_SHARE if guess is None else _ENOUGH_IN_FLIGHT):
            return field
        field = _surer(field, bridge(current.classical, other.classical))
        if sure_share(field) >= _NOTHING_SHARE:
            return field
        return FlowField(coarse.flow, np.float32(_UNCONFIRMED) * coarse.confidence)

    def track(self, current: Prepared, other: Prepared, guess: FlowField) -> FlowField | None:
        """Flow by a good guess alone, without the network; see :class:`Matcher`."""
        current, other = _check_pair(current, other)
        return self._classical.track(current.classical, other.classical, guess)

    def _ask(self, current: HybridPicture, other: HybridPicture) -> FlowField:
        """Flow of the network, and how far it can be trusted."""
        there = self._network.match(current.features, other.features)
        trust = there.confidence * stays_inside(there.flow)
        if not self._judges:
            back = self._network.match(other.features, current.features)
            trust = trust * returns(there.flow, back.flow)
        return FlowField(there.flow, trust)


def _refine(current: ClassicalPicture, other: ClassicalPicture, coarse: FlowField) -> FlowField:
    """Refine, and once more, from what the first time made precise, where much is unsure."""
    nothing = FlowField(coarse.flow, np.zeros_like(coarse.confidence))
    first = refit(current, other, coarse) or nothing
    if sure_share(first) >= _SETTLED_SHARE:
        return first
    return _surer(refit(current, other, first) or nothing, first)


def _surer(first: FlowField, second: FlowField) -> FlowField:
    """Return the flow that more of the picture is sure of."""
    return max(first, second, key=sure_share)


def _check_pair(current: Prepared, other: Prepared) -> tuple[HybridPicture, HybridPicture]:
    """Refuse pictures of different sizes or of another matcher."""
    check_same_size(current, other)
    if not (isinstance(current, HybridPicture) and isinstance(other, HybridPicture)):
        raise ImageError("pictures were prepared by another matcher", "the same matcher's")
    return current, other
