"""Published networks: path, parity and contract. Weights are random: there is no internet here."""

from __future__ import annotations

import importlib.util
import io
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

torch = pytest.importorskip("torch")

from dfvs_core.errors import ConfigError, ModelError  # noqa: E402
from dfvs_core.manifest import sha256  # noqa: E402
from dfvs_export.foreign import ForeignWeights, _read_weights, load_foreign, read_state  # noqa: E402

HAS_PTLFLOW = importlib.util.find_spec("ptlflow") is not None


class Canary:
    """Leaves a trace when a pickle runs it."""

    def __init__(self, trace: Path) -> None:
        self.trace = trace

    def __reduce__(self):
        return (Path.touch, (self.trace,))


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
        _read_weights(None, ForeignWeights(str(file)))
    with pytest.raises(ModelError, match="expected 0000"):
        _read_weights(None, ForeignWeights(str(file), "0" * 64))
    assert _read_weights(None, ForeignWeights(str(file), right)) == file.read_bytes()


def test_unknown_weights_are_answered_with_the_known_names() -> None:
    class Reference:
        pretrained_checkpoints = {"things": "https://localhost/things.ckpt"}  # noqa: RUF012

    with pytest.raises(ConfigError, match="things"):
        _read_weights(Reference, ForeignWeights("kitti", "0" * 64))


@pytest.mark.skipif(HAS_PTLFLOW, reason="ptlflow is installed")
def test_without_ptlflow_one_line_says_how_to_get_it() -> None:
    with pytest.raises(ConfigError, match="pip install ptlflow"):
        load_foreign("raft_small", ForeignWeights())


CONVERT = """
    import sys
    from pathlib import Path

    import numpy as np
    import torch

    # ptlflow imports torchvision, whose compiled operators a processor-only torch lacks; none of
    # the networks here uses them, so a definition without a body is enough to import it.
    library = torch.library.Library("torchvision", "DEF")
    for name in ("nms", "qnms"):
        library.define(f"{name}(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")

    from dfvs_export.bundles import read_bundle
    from dfvs_export.foreign import ForeignWeights, PairGraph, load_foreign, write_foreign_bundle
    from dfvs_export.running import FlowRunner

    name, out = sys.argv[1], Path(sys.argv[2])
    write_foreign_bundle(out, name, (128, 128), ForeignWeights())
    runner = FlowRunner(*read_bundle(out))
    network = PairGraph(load_foreign(name, ForeignWeights())).eval()
    rng = np.random.default_rng(0)
    first, second = (rng.integers(0, 256, (128, 128, 3), dtype=np.uint8) for _ in "ab")
    with torch.no_grad():
        expected = network(*(torch.from_numpy(runner.tensor(i)) for i in (first, second)))[0]
    found = runner.match(runner.encode(first), runner.encode(second)).flow
    difference = np.abs(found - expected.permute(1, 2, 0).numpy()).max()
    assert difference < 1e-3, difference
"""


@pytest.mark.slow
@pytest.mark.skipif(not HAS_PTLFLOW, reason="ptlflow is not installed")
@pytest.mark.parametrize("name", ["rapidflow_it3", "raft_small", "pwcnet"])
def test_torch_and_onnx_runtime_agree_on_a_published_network(name: str, tmp_path: Path) -> None:
    """In a process of its own: the operators defined for torchvision stay there."""
    subprocess.run(
        [sys.executable, "-c", textwrap.dedent(CONVERT), name, str(tmp_path / name)],
        check=True,
        timeout=280,
    )
