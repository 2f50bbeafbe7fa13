"""Published networks: path, parity and contract. Weights are random: there is no internet here."""

import importlib.util
import io
import itertools
from pathlib import Path

import numpy as np
import pytest
import safetensors.torch
import torch
from canary import Canary

from dfvs_core.errors import ConfigError, ModelError
from dfvs_core.messages.manifest import sha256
from dfvs_export.bundles.bundle import write_bundle
from dfvs_export.bundles.published_flow import PairGraph, PublishedFlow
from dfvs_export.bundles.runner import BundleRunner
from dfvs_export.checks.parity import drawn_pairs, parity
from dfvs_export.cli import main
from dfvs_export.commands import flow
from dfvs_export.precision.conversion import in_precision
from dfvs_export.weights.published import _read_weights, load_foreign, read_state
from dfvs_models.catalog import load_matcher

HAS_PTLFLOW = importlib.util.find_spec("ptlflow") is not None


def saved(value: object) -> bytes:
    file = io.BytesIO()
    torch.save(value, file)
    return file.getvalue()


def test_a_hostile_pickle_never_runs(tmp_path: Path) -> None:
    trace = tmp_path / "ran"
    data = saved({"state_dict": {"w": torch.zeros(2)}, "extra": Canary(trace)})
    with pytest.raises(ModelError, match="no plain checkpoint"):
        read_state(data, "hostile.ckpt")
    assert not trace.exists()
    torch.load(io.BytesIO(data), weights_only=False)  # the canary is able to sing
    assert trace.exists()


@pytest.mark.parametrize("wrapped", [True, False])
def test_weights_are_read_with_or_without_their_wrapping(wrapped: bool) -> None:
    state = {"w": torch.arange(3.0)}
    data = saved({"state_dict": state, "epoch": 3} if wrapped else state)
    assert torch.equal(read_state(data, "x")["w"], state["w"])


@pytest.mark.parametrize("data", [b"", b"garbage", saved([1, 2]), saved({"a": "text"})])
def test_what_holds_no_weights_is_refused(data: bytes) -> None:
    with pytest.raises(ModelError):
        read_state(data, "x")


def test_weights_need_the_hash_that_was_named_beforehand(tmp_path: Path) -> None:
    file = tmp_path / "w.ckpt"
    file.write_bytes(saved({"w": torch.zeros(1)}))
    right = sha256(file.read_bytes())
    with pytest.raises(ModelError, match=right):
        _read_weights(None, str(file), None)
    with pytest.raises(ModelError, match="expected 0000"):
        _read_weights(None, str(file), "0" * 64)
    assert _read_weights(None, str(file), right) == file.read_bytes()


def test_unknown_weights_are_answered_with_the_known_names() -> None:
    class Reference:
        pretrained_checkpoints = {"things": "https://localhost/things.ckpt"}  # noqa: RUF012

    with pytest.raises(ConfigError, match="things"):
        _read_weights(Reference, "kitti", "0" * 64)


@pytest.mark.skipif(HAS_PTLFLOW, reason="ptlflow is installed")
def test_without_ptlflow_one_line_says_how_to_get_it() -> None:
    with pytest.raises(ConfigError, match="dfvs-lab\\[published\\]"):
        load_foreign("raft_small", None, None)


SIZE = (96, 64)


class Layers(torch.nn.Module):
    """Takes and gives what a network of ptlflow does: (1, 2, 3, H, W) to (1, 1, 2, H, W)."""

    def __init__(self) -> None:
        super().__init__()
        torch.manual_seed(5)
        widths = (6, 16, 16, 2)
        self.layers = torch.nn.ModuleList(
            torch.nn.Conv2d(a, b, 3, padding=1) for a, b in itertools.pairwise(widths)
        )

    def forward(self, inputs: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
        x = inputs["images"].flatten(1, 2)
        for layer in self.layers[:-1]:
            x = torch.relu(layer(x))
        return {"flows": 20.0 * self.layers[-1](x)[:, None]}


@pytest.fixture(scope="module")
def published() -> PublishedFlow:
    return PublishedFlow("layers", PairGraph(Layers()).eval())


def test_a_network_of_two_images_agrees_with_torch_and_runs_in_the_service(
    published: PublishedFlow, tmp_path: Path
) -> None:
    bundle = published.bundle(SIZE)
    first, second = drawn_pairs(SIZE, 1, 1)[0]
    found = parity(published, BundleRunner(bundle), [(first, second)])
    assert found.holds
    write_bundle(tmp_path / "pair", bundle, "", {})
    matcher = load_matcher(str(tmp_path / "pair"), threads=1)
    field = matcher.match(matcher.encode(first), matcher.encode(second))
    assert field.flow.shape == (64, 96, 2)
    assert np.abs(field.flow).max() > 1.0  # zeros would agree too
    assert "RANDOM" in bundle.manifest.origin


@pytest.mark.parametrize(
    ("option", "is_random"), [(None, True), ("--weights", False), ("--checkpoint", False)]
)
def test_only_of_weights_that_nobody_named_it_is_said_that_they_are_random(
    published: PublishedFlow, tmp_path: Path, monkeypatch, capsys, option: str, is_random: bool
) -> None:
    monkeypatch.setattr(flow, "named_matching_network", lambda arguments: published)
    words = [option, "layers.ckpt"] if option else []
    out = str(tmp_path / "pair")
    assert main(["flow", "--model", "ptlflow:layers", *words, "--size", "96x64", "--out", out]) == 0
    assert ("weights are random" in capsys.readouterr().out) == is_random


def test_torch_and_onnx_runtime_differ_where_the_weights_do(published: PublishedFlow) -> None:
    other = PublishedFlow("layers", PairGraph(Layers()).eval())
    with torch.no_grad():
        other.graph.network.layers[-1].bias[0] += 1e-3
    found = parity(other, BundleRunner(published.bundle(SIZE)), drawn_pairs(SIZE, 1, 1))
    assert found.greatest == pytest.approx(20e-3, rel=1e-2)
    assert not found.holds


@pytest.mark.parametrize(("precision", "most_px"), [("fp16", 0.02), ("int8", 0.4)])
def test_a_network_of_two_images_is_converted_to_fewer_bits(
    published: PublishedFlow, precision: str, most_px: float
) -> None:
    """Its middle layer alone is: the first reads images, the last gives flow."""
    pairs = drawn_pairs(SIZE, 2, 2)
    rounded = in_precision(published.bundle(SIZE), precision, pairs)
    assert rounded.manifest.precision == precision
    assert 1e-5 < parity(published, BundleRunner(rounded), pairs).greatest < most_px


def test_safetensors_are_read() -> None:
    data = safetensors.torch.save({"w": torch.ones(2)})
    assert torch.equal(read_state(data, "net.safetensors")["w"], torch.ones(2))
    with pytest.raises(ModelError, match="no plain checkpoint"):
        read_state(data[:-3], "net.safetensors")
