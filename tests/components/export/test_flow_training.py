from __future__ import annotations

import csv
import itertools
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from dfvs_core.errors import ConfigError, ModelError  # noqa: E402
from dfvs_export.data.pairs import PairSettings  # noqa: E402
from dfvs_export.data.shards import write_shard  # noqa: E402
from dfvs_export.own import SHIPPED  # noqa: E402
from dfvs_export.train.checkpoint import load_checkpoint, load_network  # noqa: E402
from dfvs_export.train.flow import learning_rate, train_flow  # noqa: E402
from dfvs_export.train.settings import TrainSettings  # noqa: E402

SIZE = (96, 64)


@pytest.fixture(scope="module")
def shards(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("pairs")
    write_shard(folder, PairSettings(*SIZE), 12, 1)
    return folder


def settings(out: Path, shards: Path, steps: int, **changes: object) -> TrainSettings:
    values: dict[str, object] = {
        "pairs_per_step": 2,
        "makers": 0,
        "precision": "fp32",
        "threads": 2,
        "learning_rate": 1e-3,
        "checkpoint_minutes": 60.0,
    }
    return TrainSettings(out=out, steps=steps, size=SIZE, pairs=shards, **(values | changes))


def losses(out: Path) -> list[float]:
    with (out / "train.csv").open() as file:
        return [float(row["loss"]) for row in csv.DictReader(file)]


def test_sixty_steps_lower_the_loss(tmp_path: Path, shards: Path) -> None:
    train_flow(settings(tmp_path, shards, 60), None, lambda line: None)
    found = losses(tmp_path)
    assert len(found) == 3
    assert found[-1] < 0.85 * found[0]


def test_a_resumed_run_repeats_to_the_last_bit(tmp_path: Path, shards: Path) -> None:
    start = train_flow(settings(tmp_path / "start", shards, 2), None, lambda line: None)
    ends = [
        train_flow(settings(tmp_path / name, shards, 3), start, lambda line: None)
        for name in ("one", "two")
    ]
    one, two = (load_checkpoint(path) for path in ends)
    assert one.step == two.step == 5
    assert len(one.origin) == 2
    for name, value in one.weights.items():
        assert torch.equal(value, two.weights[name]), name
    before = load_checkpoint(start)
    assert not torch.equal(before.weights["mask.weight"], one.weights["mask.weight"])


def test_training_goes_on_from_the_shipped_weights(tmp_path: Path, shards: Path) -> None:
    last = train_flow(settings(tmp_path, shards, 2), SHIPPED, lambda line: None)
    end = load_checkpoint(last)
    start = load_checkpoint(SHIPPED)
    assert end.step == start.step + 2
    assert end.notes == start.notes != ""
    assert end.optimiser["state"]


def test_makers_supply_pairs_while_the_training_runs(tmp_path: Path) -> None:
    out = tmp_path / "run"
    told: list[str] = []
    chosen = TrainSettings(
        out=out, steps=1, size=(64, 64), pairs_per_step=1, makers=1, precision="bf16"
    )
    train_flow(chosen, None, told.append)
    assert (out / "last.pt").is_file()
    assert list((out / "pairs").glob("shard-64x64-*.npz"))


def test_validation_is_recorded_and_drawn(tmp_path: Path, shards: Path) -> None:
    rng = np.random.default_rng(0)
    images = rng.integers(0, 255, (2, 3, 64, 96, 3), dtype=np.uint8)
    file = tmp_path / "pairs.npz"
    flow = np.zeros((3, 64, 96, 2), np.float16)
    np.savez(
        file,
        IA=images[0],
        IB=images[1],
        flow=flow,
        vis=np.ones(flow.shape[:3], bool),
        level=np.arange(3),
    )
    train_flow(settings(tmp_path / "run", shards, 1, validation=file), None, lambda line: None)
    with (tmp_path / "run" / "validation.csv").open() as table:
        (row,) = csv.DictReader(table)
    assert float(row["large_epe_px"]) > 0.0
    assert (tmp_path / "run" / "validation.png").stat().st_size > 1000
    assert (tmp_path / "run" / "best.pt").is_file()


def test_no_pairs_and_no_makers_is_one_clear_error(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr("dfvs_export.train.flow._FIRST_SHARD_WAIT_S", 0.0)
    with pytest.raises(ConfigError, match="no shards of 96 x 64"):
        train_flow(settings(tmp_path, tmp_path, 1), None, lambda line: None)


@pytest.mark.parametrize("content", [b"", b"no checkpoint", b"PK\x03\x04 but broken"])
def test_a_broken_checkpoint_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "broken.pt"
    path.write_bytes(content)
    with pytest.raises(ModelError, match="no checkpoint"):
        load_network(path)


class Canary:
    """Leaves a trace when a pickle runs it."""

    def __init__(self, trace: Path) -> None:
        self.trace = trace

    def __reduce__(self):
        return (Path.touch, (self.trace,))


def test_a_hostile_checkpoint_never_runs(tmp_path: Path) -> None:
    trace = tmp_path / "ran"
    path = tmp_path / "hostile.pt"
    torch.save({"architecture": Canary(trace)}, path)
    with pytest.raises(ModelError, match="no checkpoint"):
        load_network(path)
    assert not trace.exists()
    # the canary is able to sing
    torch.load(path, weights_only=False)
    assert trace.exists()


def test_the_learning_rate_climbs_then_falls() -> None:
    rates = [learning_rate(1.0, p, 0.03) for p in np.linspace(0, 1, 101)]
    assert rates[0] < 0.1
    assert max(rates) == pytest.approx(1.0, abs=1e-3)
    assert rates[-1] == pytest.approx(0.01)
    assert all(a >= b for a, b in itertools.pairwise(rates[3:]))
