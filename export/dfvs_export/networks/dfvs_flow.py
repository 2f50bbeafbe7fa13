"""dfvs-flow: wide-baseline dense matching in two graphs, ``encode`` and ``match``.

``encode`` turns an image into features, so that a fixed goal picture costs nothing per frame.
``match`` finds where every pixel of the first image went in the second:

1. attention within and across the two images at 1/16 makes repeated things distinct;
2. all pairs of cells at 1/8 are compared; a dual softmax gives the best cell and how sure it is;
3. moving least squares of affine motions, weighted by that sureness, carry the sure matches over
   plain walls (the prior: rooms are made of planes);
4. recurrent updates look up the correlation around the estimate, at 1/8 and then at 1/4;
5. what is judged sure is spread once more, the second image is warped by the result and encoded
   anew, so that turned and scaled things look alike, and two more updates compare it at 1/4;
6. a convex combination of neighbours takes the flow to full resolution.

Shapes: N images, H x W px (multiples of 16), h8 = H / 8 and so on. Flow is in px of the full
image at every stage, as (x, y); cell (i, j) of a level of stride s has its centre at
((j + 0.5) s, (i + 0.5) s).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from dfvs_export.networks.architecture import FlowArchitecture
from dfvs_export.networks.attention import Distinction
from dfvs_export.networks.encoder import Encoder, Features
from dfvs_export.networks.least_squares import spread_affine
from dfvs_export.networks.sampling import (
    cell_centres,
    chained,
    convex_upsample,
    double,
    local_correlation,
    look_up,
    warp,
)
from dfvs_export.networks.update import Update

_MAX_SCALE = 40.0


@dataclass(frozen=True, slots=True)
class Look:
    """A look-up: scaled similarities (N, K, h, w), the flow (N, 2, h, w) around it, px per cell.

    ``base`` is the flow (N, 2, h, w) that the second image was warped by; ``flow`` then leads to
    a place of the warped image.
    """

    seen: Tensor
    flow: Tensor
    stride: int
    base: Tensor | None = None


@dataclass(frozen=True, slots=True)
class Match:
    """What ``match`` finds.

    Parameters
    ----------
    flow : (N, 2, H, W)
        px, first image to second.
    judged : tuple of (N, 2, h4, w4)
        Logits, before and after the warp: the point is visible in the second image too; the flow
        is good to about 2 px.
    stages : tuple of (N, 2, h, w)
        Flow after every stage, for training.
    looks : tuple of Look
        The look-ups at 1/4, for training.
    similarity : (N, h8 w8, h8 w8)
        Scaled cosine similarity of all pairs of cells, for training.
    """

    flow: Tensor
    judged: tuple[Tensor, ...]
    stages: tuple[Tensor, ...]
    looks: tuple[Look, ...]
    similarity: Tensor

    def confidence(self) -> Tensor:
        """Probability (N, 1, h4, w4) that the point is seen in both and its flow is good."""
        return confidence_of(self.judged[-1])


def confidence_of(judged: Tensor) -> Tensor:
    """Product (N, 1, h, w) of the probabilities of two logits (N, 2, h, w)."""
    probability = torch.sigmoid(judged)
    return probability[:, :1] * probability[:, 1:]


def best_cells(similarity: Tensor, centres: Tensor) -> tuple[Tensor, Tensor]:
    """Flow (N, 2, h8, w8) px and sureness (N, 1, h8, w8) of the dual softmax's best cells.

    The position is the mean over the 3 x 3 cells about the best one, so finer than a cell.
    """
    n, cells, _ = similarity.shape
    h, w = centres.shape[2:]
    # one exponential for both softmaxes; scaled cosines lie within +-60 of each other's maximum
    likely = torch.exp(similarity - similarity.amax(dim=(1, 2), keepdim=True))
    ones = torch.ones(n, 1, cells, dtype=likely.dtype, device=likely.device)
    rows = likely.sum(2).reshape(n, 1, h, w) + 1e-30
    columns = ones @ likely + 1e-30  # as a product: runtimes sum over rows slowly
    shared = likely * (likely * (1.0 / columns))  # not yet divided by the rows' sums
    best = shared.argmax(dim=2)  # (N, h w)
    table = centres.reshape(2, cells)
    target = torch.stack([table[0][best], table[1][best]], 1).reshape(n, 2, h, w)
    near = look_up(shared, target, 1) / rows  # (N, 9, h, w)
    total = near.sum(1, keepdim=True)
    step = torch.arange(-1, 2, device=near.device, dtype=near.dtype) * 8.0
    dx = step.repeat(3).reshape(1, 9, 1, 1)
    dy = step.repeat_interleave(3).reshape(1, 9, 1, 1)
    offset = torch.cat([(near * dx).sum(1, keepdim=True), (near * dy).sum(1, keepdim=True)], 1)
    return target + offset / (total + 1e-6) - centres, total.clamp(max=1.0)


def _unit(features: Tensor) -> Tensor:
    """Features (N, C, h, w) of length one."""
    features = features.float()
    n, c, h, w = features.shape
    ones = torch.ones(1, c, dtype=features.dtype, device=features.device)
    squares = (ones @ features.square().flatten(2)).reshape(n, 1, h, w)  # runtimes sum slowly
    return features * (squares + 1e-6).rsqrt()


def _soft(flow: Tensor, scale: float) -> Tensor:
    """Squash a displacement in px to about [-1, 1]."""
    return flow / (flow.abs() + scale)


class DfvsFlow(nn.Module):
    """The network; see the module's text."""

    def __init__(self, architecture: FlowArchitecture | None = None) -> None:
        super().__init__()
        a = architecture or FlowArchitecture()
        self.architecture = a
        self.encoder = Encoder(a)
        self.distinction = Distinction(a)
        self.log_scale = nn.Parameter(torch.tensor(math.log(12.0)))
        self.log_scale4 = nn.Parameter(torch.tensor(math.log(8.0)))
        self.update8 = Update(a.hidden8, a.width16, 5, 3, 8)
        self.update4 = Update(a.hidden4, a.fine_channels + a.hidden8, 2, 2, 4)
        self.mask = nn.Conv2d(a.hidden4, 9 * 16, 1)
        self.judge = nn.Conv2d(a.hidden4, 2, 3, padding=1)

    def encode(self, image: Tensor) -> Features:
        """Image (N, 3, H, W) in [0, 1] to features."""
        features: Features = self.encoder(image)
        return features

    def match(self, first: Features, second: Features) -> Match:
        """Flow from the first image to the second."""
        a, b = self.distinction(first, second)  # (N, 128, h8, w8)
        similarity = self._similarity(a, b)
        course = _Course(similarity)
        hidden8 = self._match_cells(a, course)
        fine = self._fine(first, hidden8)
        hidden = self._refine(fine, second, course)
        course.judge(self.judge(functional.relu(hidden)))
        course.flow = self._spread_again(course)
        hidden = self._refine_warped(fine, hidden, second, course)
        course.judge(self.judge(functional.relu(hidden)))
        full = convex_upsample(course.flow, self.mask(functional.relu(hidden)).float())
        return Match(
            full, tuple(course.judged), tuple(course.stages), tuple(course.looks), similarity
        )

    def _similarity(self, a: Tensor, b: Tensor) -> Tensor:
        """Scaled cosines (N, h8 w8, h8 w8)."""
        a, b = _unit(a) * self._scale(), _unit(b)
        return (a.flatten(2).transpose(1, 2).contiguous() @ b.flatten(2)).float()

    def _scale(self) -> Tensor:
        """Scale of the cosines at 1/8."""
        return self.log_scale.exp().clamp(max=_MAX_SCALE)

    def _match_cells(self, a: Tensor, course: _Course) -> Tensor:
        """Match cells at 1/8, spread what is sure, update; return the hidden state."""
        centres = cell_centres(a, 8)
        similarity = course.similarity.detach()
        with torch.no_grad():
            found, sureness = best_cells(similarity, centres)
            flow = spread_affine(found, sureness, centres)
        course.stages += [found, flow]
        hidden = torch.tanh(self.update8.start(a))
        for _ in range(self.architecture.updates8):
            seen = look_up(similarity, centres + flow.detach(), 3)
            motion = torch.cat([_soft(flow, 64.0), _soft(found - flow, 8.0), sureness], 1).detach()
            hidden, step = self.update8(hidden, seen, self._scale(), motion)
            flow = flow.detach() + step
            course.stages.append(flow)
        course.flow = double(flow)
        return hidden

    def _fine(self, first: Features, hidden8: Tensor) -> _Fine:
        """Prepare what the updates at 1/4 start from."""
        channels = self.architecture.fine_channels
        scale = self.log_scale4.exp().clamp(max=_MAX_SCALE)
        own = self._comparable(first.at4) * (scale * channels)
        context = torch.cat([first.at4[:, channels:], double(hidden8)], 1)
        return _Fine(own, torch.tanh(self.update4.start(context)), scale)

    def _comparable(self, at4: Tensor) -> Tensor:
        """Part (N, C, h4, w4) of the features at 1/4 that is compared, of length one."""
        return _unit(at4[:, : self.architecture.fine_channels]).contiguous()

    def _refine(self, fine: _Fine, second: Features, course: _Course) -> Tensor:
        """Update at 1/4 against the second image as it is; return the hidden state."""
        other = self._comparable(second.at4)
        hidden, flow = fine.start, course.flow
        for _ in range(self.architecture.updates4):
            seen = fine.look(other, flow.detach())
            course.looks.append(Look(seen, flow.detach(), 4))
            hidden, step = self.update4(hidden, seen, fine.scale, _soft(flow.detach(), 64.0))
            flow = flow.detach() + step
            course.stages.append(flow)
        course.flow = flow
        return hidden

    @torch.no_grad()
    def _spread_again(self, course: _Course) -> Tensor:
        """Flow (N, 2, h4, w4): its own where it is sure, what its surroundings say elsewhere."""
        sure, flow = confidence_of(course.judged[-1]), course.flow
        weight = functional.avg_pool2d(sure, 2)
        mean = functional.avg_pool2d(sure * flow, 2) / (weight + 1e-6)
        spread = double(spread_affine(mean, weight, cell_centres(weight, 8)))
        return sure * flow + (1.0 - sure) * spread

    def _refine_warped(
        self, fine: _Fine, hidden: Tensor, second: Features, course: _Course
    ) -> Tensor:
        """Update at 1/4 against the second image warped by the flow so far."""
        base = course.flow
        full = functional.interpolate(base, scale_factor=4.0, mode="bilinear")
        warped = warp(second.image, full, 1)
        other = self._comparable(self.encoder.encode_finely(warped)[1])
        rest = torch.zeros_like(base)
        for _ in range(self.architecture.updates_warped):
            seen = fine.look(other, rest.detach())
            course.looks.append(Look(seen, rest.detach(), 4, base))
            motion = _soft(course.flow.detach(), 64.0)
            hidden, step = self.update4(hidden, seen, fine.scale, motion)
            rest = rest.detach() + step
            course.flow = chained(rest, base)
            course.stages.append(course.flow)
        return hidden


@dataclass(frozen=True, slots=True)
class _Fine:
    """Scaled own features (N, C, h4, w4), the first hidden state and the similarities' bound."""

    own: Tensor
    start: Tensor
    scale: Tensor

    def look(self, other: Tensor, offset: Tensor) -> Tensor:
        """Scaled similarities (N, 25, h4, w4) around ``offset`` (N, 2, h4, w4) px in ``other``."""
        return local_correlation(self.own, warp(other, offset, 4), 2)


class _Course:
    """The flow's way through the stages; ``similarity`` is (N, h8 w8, h8 w8)."""

    flow: Tensor

    def __init__(self, similarity: Tensor) -> None:
        self.similarity = similarity
        self.stages: list[Tensor] = []
        self.looks: list[Look] = []
        self.judged: list[Tensor] = []

    def judge(self, logits: Tensor) -> None:
        """Add a judgement (N, 2, h4, w4)."""
        self.judged.append(logits.float())
