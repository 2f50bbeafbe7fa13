"""What a dfvs-flow network is built from."""

from __future__ import annotations

from dataclasses import dataclass


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
