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
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

_GLOBAL_RIDGE = 1e-3
_RIDGE = 0.02
"""Mean sureness in a window below which its correction is held back."""
_MAX_SCALE = 40.0
_SLOPE_RIDGE = 4e-5
"""The same for slopes: 0.02 matches that spread over some 5 % of the image."""


@dataclass(frozen=True, slots=True)
class FlowArchitecture:
    """Widths and depths; what a checkpoint needs to be built again."""

    width2: int = 32
    width4: int = 48
    width8: int = 96
    width16: int = 128
    attention_blocks: int = 2
    heads: int = 4
    hidden8: int = 64
    hidden4: int = 32
    updates8: int = 2
    updates4: int = 2
    updates_warped: int = 2
    fine_channels: int = 32


@dataclass(frozen=True, slots=True)
class Features:
    """What ``encode`` returns.

    (N, 128, h16, w16), (N, 96, h8, w8), (N, 64, h4, w4) and the normalised image (N, 4, H, W),
    which is warped and encoded anew at 1/4.
    """

    at16: Tensor
    at8: Tensor
    at4: Tensor
    image: Tensor

    def __getitem__(self, which: Tensor) -> Features:
        """Features of some of the images."""
        return Features(self.at16[which], self.at8[which], self.at4[which], self.image[which])


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


def _conv(channels: int, out: int, kernel: int, stride: int = 1) -> nn.Sequential:
    """Convolution, batch normalisation (folded away at export) and ReLU."""
    conv = nn.Conv2d(channels, out, kernel, stride, kernel // 2, bias=False)
    return nn.Sequential(conv, nn.BatchNorm2d(out), nn.ReLU())


class _Residual(nn.Module):
    """Two 3 x 3 convolutions around a shortcut; (N, C, h, w) to the same."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = _conv(channels, channels, 3)
        self.second = nn.Conv2d(channels, channels, 3, padding=1, bias=False)
        self.norm = nn.BatchNorm2d(channels)

    def forward(self, x: Tensor) -> Tensor:
        y: Tensor = functional.relu(x + self.norm(self.second(self.first(x))))
        return y


def _double(x: Tensor) -> Tensor:
    """Bilinear upsampling by 2."""
    return functional.interpolate(x, scale_factor=2.0, mode="bilinear", align_corners=False)


class Encoder(nn.Module):
    """Image to features at 1/16, 1/8 and 1/4."""

    def __init__(self, a: FlowArchitecture) -> None:
        super().__init__()
        self.stem = _conv(4, a.width2, 5, 2)
        self.to4 = nn.Sequential(_conv(a.width2, a.width4, 3, 2), _Residual(a.width4))
        self.to8 = nn.Sequential(_conv(a.width4, a.width8, 3, 2), _Residual(a.width8))
        self.to16 = nn.Sequential(
            _conv(a.width8, a.width16, 3, 2), _Residual(a.width16), _Residual(a.width16)
        )
        fine = 2 * a.fine_channels
        self.lateral4 = nn.Conv2d(a.width4, fine, 1)
        self.lateral8 = nn.Conv2d(a.width8, fine, 1)
        self.fine = nn.Conv2d(fine, fine, 3, padding=1)

    def forward(self, image: Tensor) -> Features:
        """Image (N, 3, H, W) in [0, 1] to features."""
        normal = normalise(image)
        x8, fine = self.encode_finely(normal)
        return Features(self.to16(x8), x8, fine, normal)

    def encode_finely(self, image: Tensor) -> tuple[Tensor, Tensor]:
        """Features at 1/8 and 1/4 of a normalised image (N, 4, H, W)."""
        x4 = self.to4(self.stem(image))
        x8 = self.to8(x4)
        return x8, self.fine(functional.relu(self.lateral4(x4) + _double(self.lateral8(x8))))


def normalise(image: Tensor) -> Tensor:
    """Take exposure and contrast out: (N, 3, H, W) in [0, 1] to (N, 4, H, W).

    Three channels are normalised over the image, the fourth over a neighbourhood of some 24 px,
    where dark plain walls show what texture they have.
    """
    mean = _mean(image)
    deviation = _mean((image - mean) ** 2).sqrt()
    grey = image.mean(1, keepdim=True)
    centred = grey - _blurred(grey)
    contrast = centred / (_blurred(centred * centred) + 2e-4).sqrt()
    return torch.cat([(image - mean) / (deviation + 0.03), contrast], 1)


def _mean(x: Tensor) -> Tensor:
    """Mean (N, 1, 1, 1) of x, by way of blocks: long sums in float32 differ between runtimes."""
    return functional.avg_pool2d(x, 8).mean((1, 2, 3), keepdim=True)


def _blurred(x: Tensor) -> Tensor:
    """Mean of x (N, 1, H, W) over some 24 px, by way of 1/8 of the resolution."""
    blocks = functional.avg_pool2d(functional.avg_pool2d(x, 8), 3, 1, 1, count_include_pad=False)
    return functional.interpolate(blocks, scale_factor=8.0, mode="bilinear", align_corners=False)


class _Attention(nn.Module):
    """Pre-norm attention of tokens (N, T, C) to a source (N, S, C), then a feed-forward part."""

    def __init__(self, channels: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.norm_query = nn.LayerNorm(channels)
        self.norm_source = nn.LayerNorm(channels)
        self.query = nn.Linear(channels, channels)
        self.key = nn.Linear(channels, channels)
        self.value = nn.Linear(channels, channels)
        self.out = nn.Linear(channels, channels)
        self.norm_forward = nn.LayerNorm(channels)
        self.forward_in = nn.Linear(channels, 2 * channels)
        self.forward_out = nn.Linear(2 * channels, channels)
        for last in (self.out, self.forward_out):
            nn.init.normal_(last.weight, std=0.01)
            nn.init.constant_(last.bias, 0.0)

    def _split(self, x: Tensor) -> Tensor:
        n, t, c = x.shape
        return x.reshape(n, t, self.heads, c // self.heads).transpose(1, 2)

    def forward(self, x: Tensor, source: Tensor) -> Tensor:
        n, t, c = x.shape
        source = self.norm_source(source)
        q = self._split(self.query(self.norm_query(x))) * (c // self.heads) ** -0.5
        k, v = self._split(self.key(source)), self._split(self.value(source))
        weights = torch.softmax(q @ k.transpose(2, 3), dim=-1)
        x = x + self.out((weights @ v).transpose(1, 2).reshape(n, t, c))
        y: Tensor = x + self.forward_out(functional.relu(self.forward_in(self.norm_forward(x))))
        return y


class _Distinction(nn.Module):
    """Makes the features of two images distinct: attention at 1/16, then fusion at 1/8."""

    def __init__(self, a: FlowArchitecture) -> None:
        super().__init__()
        self.within = nn.ModuleList(
            _Attention(a.width16, a.heads) for _ in range(a.attention_blocks)
        )
        self.across = nn.ModuleList(
            _Attention(a.width16, a.heads) for _ in range(a.attention_blocks)
        )
        self.place = nn.Conv2d(a.width16, a.width16, 3, padding=1, groups=a.width16)
        self.lateral = nn.Conv2d(a.width8, a.width16, 1)
        self.depthwise = nn.Conv2d(a.width16, a.width16, 3, padding=1, groups=a.width16)
        self.pointwise = nn.Conv2d(a.width16, a.width16, 1)

    def forward(self, first: Features, second: Features) -> tuple[Tensor, Tensor]:
        """Return two feature maps (N, 128, h8, w8)."""
        n, c, h, w = first.at16.shape
        both = torch.cat([first.at16, second.at16])
        x = (both + self.place(both)).flatten(2).transpose(1, 2)  # (2 N, h16 w16, 128)
        for within, across in zip(self.within, self.across, strict=True):
            x = within(x, x)
            x = across(x, torch.cat([x[n:], x[:n]]))
        coarse = x.transpose(1, 2).reshape(2 * n, c, h, w)
        y = self.lateral(torch.cat([first.at8, second.at8])) + _double(coarse)
        y = y + self.pointwise(functional.relu(self.depthwise(functional.relu(y))))
        return y[:n], y[n:]


def cell_centres(like: Tensor, stride: int) -> Tensor:
    """Centres (1, 2, h, w) in px of the cells of a map (N, C, h, w)."""
    h, w = like.shape[2:]
    y = (torch.arange(h, device=like.device, dtype=torch.float32) + 0.5) * stride
    x = (torch.arange(w, device=like.device, dtype=torch.float32) + 0.5) * stride
    return torch.stack([x.expand(h, w), y.unsqueeze(1).expand(h, w)]).unsqueeze(0)


def _sample(maps: Tensor, x: Tensor, y: Tensor, stride: int) -> Tensor:
    """Bilinear values (M, C, ...) of maps (M, C, h, w) at positions x, y (M, a, b) px."""
    h, w = maps.shape[2:]
    grid = torch.stack([x * (2.0 / (stride * w)) - 1.0, y * (2.0 / (stride * h)) - 1.0], dim=-1)
    return functional.grid_sample(
        maps, grid, mode="bilinear", padding_mode="zeros", align_corners=False
    )


def _look_up(volume: Tensor, target: Tensor, radius: int) -> Tensor:
    """Values around the targets.

    Parameters
    ----------
    volume : (N, h w, h w)
        One map of the second image per cell of the first (at 1/8).
    target : (N, 2, h, w)
        Where to look, px.

    Returns
    -------
    Tensor
        (N, (2 radius + 1)^2, h, w)
    """
    n, _, h, w = target.shape
    side = 2 * radius + 1
    steps = torch.arange(-radius, radius + 1, device=target.device, dtype=torch.float32) * 8.0
    dx = steps.expand(side, side).unsqueeze(0)
    dy = steps.unsqueeze(1).expand(side, side).unsqueeze(0)
    centre = target.permute(0, 2, 3, 1).reshape(n * h * w, 2, 1, 1)
    maps = volume.reshape(n * h * w, 1, h, w)
    values = _sample(maps, centre[:, 0] + dx, centre[:, 1] + dy, 8)
    return values.reshape(n, h, w, side * side).permute(0, 3, 1, 2)


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
    near = _look_up(shared, target, 1) / rows  # (N, 9, h, w)
    total = near.sum(1, keepdim=True)
    step = torch.arange(-1, 2, device=near.device, dtype=near.dtype) * 8.0
    dx = step.repeat(3).reshape(1, 9, 1, 1)
    dy = step.repeat_interleave(3).reshape(1, 9, 1, 1)
    offset = torch.cat([(near * dx).sum(1, keepdim=True), (near * dy).sum(1, keepdim=True)], 1)
    return target + offset / (total + 1e-6) - centres, total.clamp(max=1.0)


def spread_affine(flow: Tensor, weight: Tensor, centres: Tensor) -> Tensor:
    """Moving least squares of affine flows, coarse to fine: sure cells speak for plain ones.

    First one robust affine motion for the whole image; then, over windows of 17, 9 and 5 cells,
    an affine correction of the coarser solution, held back by a ridge where little is sure.

    Parameters
    ----------
    flow : (N, 2, h, w)
        px.
    weight : (N, 1, h, w)
        Sureness, 0 to 1.
    centres : (1, 2, h, w)
        px.
    """
    scale = centres.amax()
    place = 2.0 * centres / scale - 1.0  # (1, 2, h, w) in [-1, 1]
    spread = torch.zeros_like(flow)
    robust = weight
    for width in (0.0, 0.25, 0.1):  # shares of the image
        if width > 0:
            robust = _robust(weight, flow - spread, width * scale)
        spread = _fit_globally(_moments(robust, flow, place).mean((2, 3), keepdim=True), place)
    for window, width in ((17, 0.1), (9, 0.06), (5, 0.04)):
        rest = flow - spread
        robust = _robust(weight, rest, width * scale)
        spread = spread + _fit_locally(_box(_moments(robust, rest, place), window), place)
    return spread


def _robust(weight: Tensor, rest: Tensor, width: Tensor) -> Tensor:
    """Geman and McClure's weights (N, 1, h, w) for residuals (N, 2, h, w) px."""
    error = (rest * rest).sum(1, keepdim=True)
    share = 1.0 / (1.0 + error / (width * width))
    return weight * share * share


def _moments(weight: Tensor, flow: Tensor, place: Tensor) -> Tensor:
    """Integrands (N, 12, h, w): w (1, x, y, xx, xy, yy), then w (u, v), w x (u, v), w y (u, v)."""
    x, y = place[:, :1], place[:, 1:]
    powers = torch.cat([torch.ones_like(x), x, y, x * x, x * y, y * y], 1)
    weighted = weight * flow
    return torch.cat([weight * powers, weighted, weighted * x, weighted * y], 1)


def _fit_globally(moments: Tensor, place: Tensor) -> Tensor:
    """Flow (N, 2, h, w) of the affine fit to moments (N, 12, 1, 1): 3 x 3 in closed form."""
    moments = moments / (moments[:, :1] + 1e-6)
    a, b, c, d, e, f = torch.split(moments[:, :6], 1, 1)
    a, d, f = a + _GLOBAL_RIDGE, d + _GLOBAL_RIDGE, f + _GLOBAL_RIDGE
    right, right_x, right_y = torch.split(moments[:, 6:], 2, 1)  # (N, 2, 1, 1) each
    cof_a, cof_b, cof_c = d * f - e * e, c * e - b * f, b * e - c * d
    cof_d, cof_e, cof_f = a * f - c * c, b * c - a * e, a * d - b * b
    determinant = a * cof_a + b * cof_b + c * cof_c
    middle = (cof_a * right + cof_b * right_x + cof_c * right_y) / determinant
    slope_x = (cof_b * right + cof_d * right_x + cof_e * right_y) / determinant
    slope_y = (cof_c * right + cof_e * right_x + cof_f * right_y) / determinant
    return middle + slope_x * place[:, :1] + slope_y * place[:, 1:]


def _box(x: Tensor, window: int) -> Tensor:
    """Mean over a square window, as two thin passes; outside counts as zero."""
    half = window // 2
    x = functional.avg_pool2d(x, (window, 1), 1, (half, 0))
    return functional.avg_pool2d(x, (1, window), 1, (0, half))


def _fit_locally(moments: Tensor, place: Tensor) -> Tensor:
    """Value (N, 2, h, w) at each cell of the ridge-held affine fit to its own moments."""
    m, mx, my, mxx, mxy, myy = torch.split(moments[:, :6], 1, 1)
    x, y = place[:, :1], place[:, 1:]
    # moments about the cell's own place
    cx, cy = mx - x * m, my - y * m
    cxx = mxx - x * (mx + cx) + _SLOPE_RIDGE
    cxy = mxy - x * my - y * cx
    cyy = myy - y * (my + cy) + _SLOPE_RIDGE
    right, right_x, right_y = torch.split(moments[:, 6:], 2, 1)  # (N, 2, h, w) each
    right_x, right_y = right_x - x * right, right_y - y * right
    determinant = cxx * cyy - cxy * cxy
    slope_x = (cx * cyy - cy * cxy) / determinant
    slope_y = (cy * cxx - cx * cxy) / determinant
    top = right - slope_x * right_x - slope_y * right_y
    bottom = m + _RIDGE - slope_x * cx - slope_y * cy
    return top / bottom.clamp(min=1e-4)


class _Update(nn.Module):
    """One recurrent update; hidden state (N, C, h, w).

    A softmax over the looked-up similarities proposes a step of its own, right from the start of
    the training; what is learned is how far to trust it, and what to add.

    Parameters
    ----------
    channels : int
        Width C of the hidden state.
    context : int
        Channels that the hidden state starts from.
    cues : int
        Channels of motion cues besides the similarities.
    radius, stride : int
        Of the look-up, in cells, and px per cell.
    """

    offsets: Tensor

    def __init__(self, channels: int, context: int, cues: int, radius: int, stride: int) -> None:
        super().__init__()
        c = channels
        looked = (2 * radius + 1) ** 2
        self.stride = stride
        self.start = nn.Conv2d(context, c, 1)
        self.look = nn.Conv2d(looked + 2 + cues, c, 1)
        self.mix = nn.Conv2d(2 * c, c, 3, padding=1)
        self.step = nn.Conv2d(c, c, 3, padding=1)
        self.flow = nn.Conv2d(c, 3, 3, padding=1)
        nn.init.normal_(self.flow.weight, std=1e-3)
        nn.init.constant_(self.flow.bias, 0.0)  # type: ignore[arg-type]
        step = torch.arange(-radius, radius + 1, dtype=torch.float32) * stride
        side = len(step)
        kernel = torch.stack([torch.ones(looked), step.repeat(side), step.repeat_interleave(side)])
        self.register_buffer("offsets", kernel.reshape(3, looked, 1, 1), persistent=False)

    def forward(
        self, hidden: Tensor, seen: Tensor, highest: Tensor, motion: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Take the next step.

        Parameters
        ----------
        hidden : (N, C, h, w)
            State.
        seen : (N, (2 radius + 1)^2, h, w) float32
            Scaled similarities around the present estimate.
        highest : scalar
            Bound of their values.
        motion : (N, cues, h, w)
            Motion cues.

        Returns
        -------
        tuple of Tensor
            State, and flow to add (N, 2, h, w) px.
        """
        likely = torch.exp(seen - highest)
        sums = functional.conv2d(likely.float(), self.offsets)  # (N, 3, h, w): 1, dx, dy
        proposed = sums[:, 1:] / (sums[:, :1] + 1e-30)
        cues = torch.cat([seen * 0.25, proposed / self.stride, motion], 1)
        x = functional.relu(self.look(cues))
        x = functional.relu(self.mix(torch.cat([hidden, x], 1)))
        hidden = hidden + self.step(x)
        out = self.flow(functional.relu(hidden)).float()
        return hidden, self.stride * out[:, :2] + torch.sigmoid(out[:, 2:]) * proposed


def local_correlation(first: Tensor, second: Tensor, radius: int) -> Tensor:
    """Mean products (N, (2 radius + 1)^2, h, w) of features (N, C, h, w) with shifted ones."""
    if torch.is_grad_enabled():
        correlated: Tensor = _LocalCorrelation.apply(first, second, radius)  # type: ignore[no-untyped-call]
        return correlated
    n, c, h, w = first.shape
    mean = torch.full((n, 1, c), 1.0 / c, dtype=first.dtype, device=first.device)
    # a product with a row of ones: runs much faster than a mean over the channels does
    values = [mean @ (first * part).flatten(2) for part in _shifted(second, radius)]
    return torch.cat(values, 1).reshape(n, -1, h, w)


def _shifted(features: Tensor, radius: int) -> list[Tensor]:
    """Views of the features moved by up to ``radius`` cells, row by row; zeros come in."""
    h, w = features.shape[2:]
    padded = functional.pad(features, (radius, radius, radius, radius))
    side = range(2 * radius + 1)
    return [padded[:, :, i : i + h, j : j + w] for i in side for j in side]


class _LocalCorrelation(torch.autograd.Function):
    """The same with a gradient that adds in place: five times faster than autograd's own."""

    @staticmethod
    def forward(ctx: Any, first: Tensor, second: Tensor, radius: int) -> Tensor:
        ctx.save_for_backward(first, second)
        ctx.radius = radius
        return torch.stack([(first * part).mean(1) for part in _shifted(second, radius)], 1)

    @staticmethod
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, Tensor, None]:
        first, second = ctx.saved_tensors
        r = ctx.radius
        to_first = torch.zeros_like(first)
        to_padded = functional.pad(torch.zeros_like(second), (r, r, r, r))
        h, w = second.shape[2:]
        scaled = grad / first.shape[1]
        for k, part in enumerate(_shifted(second, r)):
            i, j = divmod(k, 2 * r + 1)
            slope = scaled[:, k : k + 1]
            to_first.addcmul_(slope, part)
            to_padded[:, :, i : i + h, j : j + w].addcmul_(slope, first)
        return to_first, to_padded[:, :, r : r + h, r : r + w], None


def _unit(features: Tensor) -> Tensor:
    """Features (N, C, h, w) of length one."""
    features = features.float()
    return features * (features.square().sum(1, keepdim=True) + 1e-6).rsqrt()


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
        self.distinction = _Distinction(a)
        self.log_scale = nn.Parameter(torch.tensor(math.log(12.0)))
        self.log_scale4 = nn.Parameter(torch.tensor(math.log(8.0)))
        self.update8 = _Update(a.hidden8, a.width16, 5, 3, 8)
        self.update4 = _Update(a.hidden4, a.fine_channels + a.hidden8, 2, 2, 4)
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
            seen = _look_up(similarity, centres + flow.detach(), 3)
            motion = torch.cat([_soft(flow, 64.0), _soft(found - flow, 8.0), sureness], 1).detach()
            hidden, step = self.update8(hidden, seen, self._scale(), motion)
            flow = flow.detach() + step
            course.stages.append(flow)
        course.flow = _double(flow)
        return hidden

    def _fine(self, first: Features, hidden8: Tensor) -> _Fine:
        """Prepare what the updates at 1/4 start from."""
        channels = self.architecture.fine_channels
        scale = self.log_scale4.exp().clamp(max=_MAX_SCALE)
        own = _unit(first.at4[:, :channels]).contiguous() * (scale * channels)
        context = torch.cat([first.at4[:, channels:], _double(hidden8)], 1)
        return _Fine(own, torch.tanh(self.update4.start(context)), scale)

    def _refine(self, fine: _Fine, second: Features, course: _Course) -> Tensor:
        """Update at 1/4 against the second image as it is; return the hidden state."""
        other = _unit(second.at4[:, : self.architecture.fine_channels]).contiguous()
        centres = cell_centres(other, 4)
        hidden, flow = fine.start, course.flow
        for _ in range(self.architecture.updates4):
            target = centres + flow.detach()
            there = _sample(other, target[:, 0], target[:, 1], 4)
            seen = local_correlation(fine.own, there, 2)
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
        spread = _double(spread_affine(mean, weight, cell_centres(weight, 8)))
        return sure * flow + (1.0 - sure) * spread

    def _refine_warped(
        self, fine: _Fine, hidden: Tensor, second: Features, course: _Course
    ) -> Tensor:
        """Update at 1/4 against the second image warped by the flow so far."""
        base = course.flow
        full = functional.interpolate(base, scale_factor=4.0, mode="bilinear")
        target = cell_centres(full, 1) + full
        warped = _sample(second.image, target[:, 0], target[:, 1], 1)
        channels = self.architecture.fine_channels
        other = _unit(self.encoder.encode_finely(warped)[1][:, :channels]).contiguous()
        centres = cell_centres(other, 4)
        rest = torch.zeros_like(base)
        for _ in range(self.architecture.updates_warped):
            target = centres + rest.detach()
            there = _sample(other, target[:, 0], target[:, 1], 4)
            seen = local_correlation(fine.own, there, 2)
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


def chained(first: Tensor, second: Tensor) -> Tensor:
    """Flow (N, 2, h4, w4) px of going ``first`` and from there ``second``, both at 1/4."""
    h, w = second.shape[2:]
    target = cell_centres(second, 4) + first
    x = target[:, 0].clamp(2.0, 4.0 * w - 2.0)
    y = target[:, 1].clamp(2.0, 4.0 * h - 2.0)
    return first + _sample(second, x, y, 4)


def convex_upsample(flow: Tensor, mask: Tensor) -> Tensor:
    """Flow (N, 2, h, w) to (N, 2, 4 h, 4 w): convex sums of 3 x 3 neighbours, as in RAFT.

    ``mask`` is (N, 9 * 16, h, w) logits.
    """
    n, _, h, w = flow.shape
    logits = mask.reshape(n, 9, 16, h, w)
    weights = torch.exp(logits - logits.amax(1, keepdim=True)).unbind(1)  # 9 of (N, 16, h, w)
    padded = functional.pad(flow, (1, 1, 1, 1), mode="replicate")
    x, y, total = (torch.zeros_like(weights[0]) for _ in range(3))
    for k, weight in enumerate(weights):
        i, j = divmod(k, 3)
        near = padded[:, :, i : i + h, j : j + w].unsqueeze(2)  # (N, 2, 1, h, w)
        total = total + weight
        x = x + weight * near[:, 0]
        y = y + weight * near[:, 1]
    return functional.pixel_shuffle(torch.cat([x / total, y / total], 1), 4)
