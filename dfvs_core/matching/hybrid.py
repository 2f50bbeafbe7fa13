"""A network that finds the way, and a classical matcher that makes it precise.

A network's flow is rarely wrong as a whole, but seldom good to a fraction of a pixel; dense
inverse search is the other way round. So the flow of the frame before, or the chance that little
moved, is tried first. Where neither holds the network is run and its flow refined: first on the
other picture warped by the flow of the frame before, then on the picture as it is. Where much of
that is unsure, the network looks again, at the picture warped by what was found: what is left of
the motion is small, and it is at its best there. In a first match that is not clear then, features
are matched too: one surface after the other is refined, and the network looks from there. Where
little speaks for any of that, enlarged parts of the picture are matched as well. What most speaks
for is taken, and the network's own flow where none is sure of anything. What a first match is
unsure of is searched along epipolar lines at last: most often that is another surface than the one
that was found. As long as all that is sure lies in a small part of the picture, that is enlarged.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dfvs_core.arrays import BoolArray, Float32Array, ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.errors import ImageError
from dfvs_core.matching.classical import (
    ClassicalMatcher,
    ClassicalPicture,
    carry_on,
    feature_starts,
    holds,
    refine_twice,
    refit,
    start_near,
    usable,
)
from dfvs_core.matching.closer_look import STAGES, TURNED_STAGES, Part, Stages, part_around
from dfvs_core.matching.completion import NOTHING_SHARE, search_lines
from dfvs_core.matching.matcher import Matcher, Prepared, check_same_size
from dfvs_core.matching.merit import (
    Candidate,
    agreement,
    assessed,
    best_of,
    joined,
    merit_of,
    passing_over,
)
from dfvs_core.matching.motion import motion_of
from dfvs_core.matching.sureness import only, sure_share, surer, surer_of_each, unsure
from dfvs_core.matching.texture import has_texture
from dfvs_core.matching.trust import returns, stays_inside
from dfvs_core.matching.warping import bring, compose

_SETTLED_SHARE = 0.65
"""Share of sure pixels from which on nothing is looked at or refined a second time."""
_LEFT_SHARE = 0.05
"""Share of sure pixels that a flight goes on by."""
_DOUBTFUL_MERIT = 0.05
"""Merit of a first match under which parts of the picture are looked at as well."""
_FEEBLE_MERIT = 0.02
"""Merit under which turned parts are looked at too, where the camera may roll."""
_PROMISING_SHARE, _GLIMPSE_SHARE = 0.1, 0.03
"""Shares of a part that the network is sure of from which on no smaller ones are looked at, and
under which it is passed over."""
_CLOSER_LOOKS = 3
"""Parts that are matched, of those that were looked at."""
_CLOSER_DISCOUNT = 1.5
"""What a part shows counts less than what the whole picture does, not for its size alone."""
_UNCONFIRMED = 0.5
"""Factor on the confidence of a network's flow that no refinement has confirmed."""


class HybridPicture(Prepared):
    """A picture prepared for both; for the network, when it is first asked for."""

    def __init__(self, image: ImageArray, classical: ClassicalMatcher, network: Matcher) -> None:
        self.classical = classical.prepare(image)
        super().__init__(self.classical.size)
        self._network = network

    @cached_property
    def features(self) -> Prepared:
        """The network's features: some 2 MB at 320 x 240 px."""
        return self._network.prepare(self.classical.image)

    def slim(self) -> None:
        """Let go of the features of both."""
        self.__dict__.pop("features", None)
        self.classical.slim()


@dataclass(frozen=True, slots=True)
class _Glimpse:
    """What the network sees in an enlarged part of a picture."""

    part: Part
    picture: HybridPicture
    inside: BoolArray
    textured: BoolArray
    coarse: FlowField
    besides: Sequence[FlowField]

    @property
    def share(self) -> float:
        """Share of the part that it is sure of."""
        return sure_share(self.coarse)


class HybridMatcher:
    """Dense correspondences by a network, refined; see the module's text.

    Parameters
    ----------
    network : Matcher
        What to ask where little is known.
    judges : bool
        Whether the network says itself how far its flow can be trusted; where it does not, it is
        also asked for the way back.
    any_roll : bool
        Whether one picture may be rolled against the other by more than the network bridges. A
        vehicle that stays level need not pay for it.
    """

    def __init__(self, network: Matcher, judges: bool, any_roll: bool = False) -> None:
        self._classical = ClassicalMatcher()
        self._network = network
        self._judges = judges
        self._any_roll = any_roll

    def prepare(self, image: ImageArray) -> HybridPicture:
        """Take a picture (H, W, 3) uint8 RGB."""
        return HybridPicture(image, self._classical, self._network)

    def match(
        self,
        current: Prepared,
        other: Prepared,
        guess: FlowField | None = None,
        *,
        besides: Sequence[FlowField] = (),
    ) -> FlowField:
        """Flow from ``current`` to ``other``; see :class:`Matcher`."""
        current, other = _check_pair(current, other)
        if guess is None:
            return passing_over(self._match_first(current, other, besides), besides)
        followed = self._match_from(current, other, guess)
        if followed is None:
            coarse = self._ask(current.features, other.features)
            followed = _confirmed(_refine(current.classical, other.classical, coarse), coarse)
        return passing_over(followed, besides)

    def track(self, current: Prepared, other: Prepared, guess: FlowField) -> FlowField | None:
        """Flow by a good guess alone, without the network; see :class:`Matcher`."""
        current, other = _check_pair(current, other)
        return self._classical.track(current.classical, other.classical, guess)

    def _match_first(
        self, current: HybridPicture, other: HybridPicture, besides: Sequence[FlowField]
    ) -> FlowField:
        """Match two pictures about whose relation nothing is known, but perhaps what it is not."""
        field = None if besides else start_near(current.classical, other.classical)
        if field is not None:
            return search_lines(current.classical, other.classical, field)
        coarse = self._ask(current.features, other.features)
        field = self._settle(current, other, coarse)
        field = self._bridge(current, other, field, besides)
        field = search_lines(current.classical, other.classical, field)
        return _confirmed(field, coarse)

    def _match_from(
        self, current: HybridPicture, other: HybridPicture, guess: FlowField
    ) -> FlowField | None:
        """Match by the flow of the frame before, which dense inverse search could not hold.

        Where the network cannot either, but enough is left of it, that is kept: a frame from
        scratch takes longer than a flight can wait.
        """
        if not usable(guess, current.size):
            return None
        part = part_around(guess)
        if part is None:
            return self._hold(current, other, guess)
        picture = self.prepare(part.cut(current.classical.image))
        field = self._hold(picture, other, part.of(guess))
        return None if field is None else part.whole(field)

    def _hold(
        self, current: HybridPicture, other: HybridPicture, guess: FlowField
    ) -> FlowField | None:
        """Look from the flow of the frame before, and take what is left of that where need be."""
        again = self._look_again(current, other, guess)
        if holds(again, guess):
            return again
        left = carry_on(current.classical, other.classical, guess)
        field = again if left is None else surer_of_each(left, again)
        return field if sure_share(field) >= _LEFT_SHARE else None

    def _settle(self, current: HybridPicture, other: HybridPicture, coarse: FlowField) -> FlowField:
        """Refine the network's flow, and let it look again where much is unsure then."""
        field = _refine(current.classical, other.classical, coarse)
        if sure_share(field) >= _SETTLED_SHARE:
            return field
        known = field if _worth(field) >= NOTHING_SHARE else coarse
        return surer_of_each(field, self._look_again(current, other, known))

    def _bridge(
        self,
        current: HybridPicture,
        other: HybridPicture,
        found: FlowField,
        besides: Sequence[FlowField],
    ) -> FlowField:
        """Take what the network has found, what features lead to, or what a closer look shows."""
        starts = feature_starts(current.classical, other.classical)
        others = (self._from_start(current, other, start) for start in starts)
        fields = (passing_over(field, besides) for field in itertools.chain([found], others))
        textured = has_texture(current.classical.grey)
        best = best_of(assessed(field, textured) for field in fields)
        if best is not None and best.merit >= _DOUBTFUL_MERIT:
            return best.field
        candidates = [best or assessed(found, textured)]
        candidates += self._look_closer(current, other, STAGES, besides)
        if self._any_roll and max(each.merit for each in candidates) < _FEEBLE_MERIT:
            candidates += self._look_closer(current, other, TURNED_STAGES, besides)
        return joined(candidates)

    def _look_closer(
        self,
        current: HybridPicture,
        other: HybridPicture,
        stages: Stages,
        besides: Sequence[FlowField],
    ) -> Iterator[Candidate]:
        """Match enlarged parts of a picture: those that the network is surest of.

        The whole of one picture is often seen from afar in a small part of the other.
        """
        glimpses = self._glimpses(current, other, stages, besides)
        for glimpse in heapq.nlargest(_CLOSER_LOOKS, glimpses, key=lambda glimpse: glimpse.share):
            if glimpse.share < _GLIMPSE_SHARE:
                return
            picture, inside = glimpse.picture, glimpse.inside
            field = only(self._settle(picture, other, glimpse.coarse), inside)
            field = passing_over(field, glimpse.besides)
            merit = merit_of(field, glimpse.textured) / (_CLOSER_DISCOUNT * glimpse.part.zoom)
            field = only(search_lines(picture.classical, other.classical, field), inside)
            yield Candidate(glimpse.part.whole(field), merit)

    def _glimpses(
        self,
        current: HybridPicture,
        other: HybridPicture,
        stages: Stages,
        besides: Sequence[FlowField],
    ) -> Iterator[_Glimpse]:
        """Show the network the parts of a picture; later ones where those before show nothing."""
        most = 0.0
        textured = has_texture(current.classical.grey).astype(np.uint8)
        for parts in stages:
            for part in parts:
                inside = part.inside(current.size)
                there = (part.cut(textured) > 0) & inside
                if not there.any():
                    continue
                picture = self.prepare(part.cut(current.classical.image))
                wrong = [part.of(each) for each in besides]
                coarse = only(self._ask(picture.features, other.features), inside)
                coarse = passing_over(coarse, wrong)
                glimpse = _Glimpse(part, picture, inside, there, coarse, wrong)
                most = max(most, glimpse.share)
                yield glimpse
            if most >= _PROMISING_SHARE:
                return

    def _from_start(
        self, current: HybridPicture, other: HybridPicture, start: Float32Array
    ) -> FlowField:
        """Flow from where features lead to: refined, and seen by the network; the surer of each."""
        refined = refine_twice(current.classical, other.classical, start)
        known = FlowField(start, np.ones(current.size, np.float32))
        return surer_of_each(refined, self._look_again(current, other, known))

    def _look_again(
        self, current: HybridPicture, other: HybridPicture, known: FlowField
    ) -> FlowField:
        """Flow by what the network sees once the other picture is warped by what is known.

        Without any confidence where too little is known to warp by, or too little comes of it.
        """
        nothing = unsure(known)
        motion = motion_of(known)
        if motion is None:
            return nothing
        start = motion.flow()
        warped = self._network.prepare(bring(other.classical.image, start))
        left = self._ask(current.features, warped)
        flow = compose(left.flow, start)
        found = FlowField(flow, left.confidence * stays_inside(flow))
        return refit(current.classical, other.classical, found) or nothing

    def _ask(self, current: Prepared, other: Prepared) -> FlowField:
        """Flow of the network between its features, and how far it can be trusted."""
        there = self._network.match(current, other)
        trust = there.confidence * stays_inside(there.flow)
        if not self._judges:
            back = self._network.match(other, current)
            trust = trust * returns(there.flow, back.flow)
        return FlowField(there.flow, trust)


def _refine(current: ClassicalPicture, other: ClassicalPicture, coarse: FlowField) -> FlowField:
    """Refine, and once more, from what the first time made precise, where much is unsure."""
    nothing = unsure(coarse)
    first = refit(current, other, coarse) or nothing
    if sure_share(first) >= _SETTLED_SHARE:
        return first
    return surer(refit(current, other, first) or nothing, first)


def _worth(field: FlowField) -> float:
    """Share of sure pixels; less where no motion of a camera explains them, as chance matches."""
    return sure_share(field) * agreement(field)


def _confirmed(field: FlowField, coarse: FlowField) -> FlowField:
    """Return what refinement has made of a network's flow; that itself, unsure, if nothing."""
    if _worth(field) >= NOTHING_SHARE:
        return field
    return FlowField(coarse.flow, np.float32(_UNCONFIRMED) * coarse.confidence)


def _check_pair(current: Prepared, other: Prepared) -> tuple[HybridPicture, HybridPicture]:
    """Refuse pictures of different sizes or of another matcher."""
    check_same_size(current, other)
    if not (isinstance(current, HybridPicture) and isinstance(other, HybridPicture)):
        raise ImageError("pictures were prepared by another matcher", "the same matcher's")
    return current, other
