"""``dfvs-bench flow`` on a pairs file made here."""

import json

import numpy as np
import pytest
from lucas_kanade_network import write_bundle
from subcommand import run_subcommand
from textured_wall import Wall, exact_flow, inside, texture, turned

from dfvs_bench.commands import flow
from dfvs_core.errors import DfvsError

MOTIONS = [turned(shift=(4.0, 2.0)), turned(roll_deg=12.0), turned(roll_deg=30.0, zoom=1.2)]


@pytest.fixture(scope="module")
def pairs(tmp_path_factory):
    wall = Wall(texture(np.random.default_rng(2)))
    flows = [exact_flow(H) for H in MOTIONS]
    path = tmp_path_factory.mktemp("pairs") / "wall.npz"
    np.savez(
        path,
        IA=np.stack([wall.picture()] * 3),
        IB=np.stack([wall.picture(H) for H in MOTIONS]),
        flow=np.stack(flows).astype(np.float16),
        vis=np.stack([inside(flow) for flow in flows]),
        level=np.arange(3),
    )
    return path


def bench(*words):
    return run_subcommand(flow, *words)


def test_the_table_and_the_json_tell_precision_by_level(pairs, tmp_path, capsys):
    out = tmp_path / "flow.json"
    assert bench(pairs, "--bundle", "classical", "--json", out) == 0
    table = capsys.readouterr().out
    report = json.loads(out.read_text())
    assert report["bundle"] == "classical"
    assert list(report["files"]) == ["wall.npz"]
    assert list(report["files"]["wall.npz"]) == ["small", "medium", "large"]
    for level, score in report["files"]["wall.npz"].items():
        assert level in table
        assert score["pairs"] == 1
        assert 0.0 < score["epe_px"] < 0.5
        assert score["under_3px"] > 0.97
        assert score["confident_failures"] == 0
    assert report["ms_per_pair"] > report["ms_per_pair_with_guess"] > 0.0


def test_several_bundles_and_files_make_a_list_of_reports(pairs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "room").mkdir()
    files = [str(tmp_path / "wall.npz"), "room/wall.npz", "other.npz"]
    with np.load(pairs) as arrays:
        for file in files:
            np.savez(file, **{name: array[:1] for name, array in arrays.items()})
    names = ["classical", str(write_bundle(tmp_path / "bundle"))]
    assert bench(*files, "--bundle", names[0], "--bundle", names[1], "--json", "out.json") == 0
    reports = json.loads((tmp_path / "out.json").read_text())
    assert [report["bundle"] for report in reports] == names
    for report in reports:
        assert list(report["files"]) == files
        first, second, _ = report["files"].values()
        assert first == second


def test_a_bundle_of_another_size_gives_flow_of_the_pictures_size(pairs, tmp_path):
    """Flow of pictures half as wide that were not scaled back would be off by 2.2 px."""
    out = tmp_path / "flow.json"
    bundle = write_bundle(tmp_path / "half")
    assert bench(pairs, "--bundle", bundle, "--json", out) == 0
    small = json.loads(out.read_text())["files"]["wall.npz"]["small"]
    assert small["epe_px"] < 1.0
    assert small["confident_half_epe_px"] < 0.3


def test_files_that_are_no_pairs_are_refused(tmp_path, pairs):
    (tmp_path / "text.npz").write_text("hello")
    (tmp_path / "cut.npz").write_bytes(pairs.read_bytes()[:-2000])
    np.save(tmp_path / "single.npy", np.zeros(3))
    (tmp_path / "single.npy").rename(tmp_path / "single.npz")
    np.savez(tmp_path / "other.npz", IA=np.zeros(3))
    with np.load(pairs) as good:
        arrays = dict(good)
    blind = arrays["vis"].copy()
    blind[1] = False
    endless = arrays["flow"].copy()
    endless[0, 50, 50] = np.nan
    changed = {
        "level": {"level": np.array([0, 1, 7])},
        "shape": {"vis": np.ones((3, 5, 5), bool)},
        "flat": {"IA": np.zeros(3, np.uint8)},
        "floats": {"IB": arrays["IB"].astype(np.float32)},
        "pickled": {"level": np.array([0, 1, None])},
        "blind": {"vis": blind},
        "endless": {"flow": endless, "vis": np.ones_like(blind)},
    }
    for name, change in changed.items():
        np.savez(tmp_path / f"{name}.npz", **(arrays | change))
    for name, message in {
        **dict.fromkeys(("absent", "text", "cut", "single", "other"), "cannot be read"),
        "pickled": "cannot be read",
        "level": "levels 0, 1, 2",
        "shape": "vis in .* has the shape",
        "flat": "IA in .* has the shape",
        "floats": "IB in .* is float32",
        "blind": "pair 1 in .* has no pixel",
        "endless": "flow in .* is not finite",
    }.items():
        with pytest.raises(DfvsError, match=message):
            bench(tmp_path / f"{name}.npz", "--bundle", "classical")
