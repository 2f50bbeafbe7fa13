"""One recurrent update of the flow from what a look-up has seen."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional


class Update(nn.Module):
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
        self.register_buffer("offsets", kernel, persistent=False)

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
        sums = self.offsets @ likely.float().flatten(2)  # (N, 3, h w): 1, dx, dy
        sums = sums.reshape(-1, 3, *seen.shape[2:])
        proposed = sums[:, 1:] / (sums[:, :1] + 1e-30)
        cues = torch.cat([seen * 0.25, proposed / self.stride, motion], 1)
        x = functional.relu(self.look(cues))
        x = functional.relu(self.mix(torch.cat([hidden, x], 1)))
        hidden = hidden + self.step(x)
        out = self.flow(functional.relu(hidden)).float()
        return hidden, self.stride * out[:, :2] + torch.sigmoid(out[:, 2:]) * proposed
