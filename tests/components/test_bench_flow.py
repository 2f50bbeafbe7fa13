"""``dfvs-bench flow`` on a pairs file made here."""

import argparse
import json

import numpy as np
import pytest
from textured_wall import Wall, exact_flow, inside, texture, turned

from dfvs_core.errors import DfvsError
from dfvs_sim.commands import bench_flow

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
    parser = argparse.ArgumentParser()
    bench_flow.add_parser(parser.add_subparsers())
    args = parser.parse_args(["flow", *map(str, words)])
    return args.run(args)


def test_the_table_and_the_json_tell_precision_by_level(pairs, tmp_path, capsys):
    out = tmp_path / "flow.json"
    assert bench(pairs, "--bundle", "classical", "--json", out) == 0
    table = capsys.readouterr().out
    report = json.loads(out.read_text())
    assert report["bundle"] == "classical"
    assert list(report["files"]["wall"]) == ["small", "medium", "large"]
    for level, score in report["files"]["wall"].items():
        assert level in table
        assert score["pairs"] == 1
        assert 0.0 < score["epe_px"] < 0.5
        assert score["under_3px"] > 0.97
        assert score["failed_but_sure"] == 0
    assert report["ms_per_pair"] > report["ms_per_pair_with_guess"] > 0.0


def test_what_it_cannot_measure_is_answered_with_what_it_can(pairs):
    with pytest.raises(DfvsError, match="no matcher 'raft' here; expected one of classical"):
        bench(pairs, "--bundle", "raft")


def test_files_that_are_no_pairs_are_refused(tmp_path, pairs):
    (tmp_path / "text.npz").write_text("hello")
    np.savez(tmp_path / "other.npz", IA=np.zeros(3))
    with np.load(pairs) as good:
        arrays = dict(good)
    np.savez(tmp_path / "level.npz", **(arrays | {"level": np.array([0, 1, 7])}))
    np.savez(tmp_path / "shape.npz", **(arrays | {"vis": np.ones((3, 5, 5), bool)}))
    for name, message in {
        "absent": "cannot be read",
        "text": "cannot be read",
        "other": "cannot be read",
        "level": "levels 0, 1, 2",
        "shape": "vis in .* has the shape",
    }.items():
        with pytest.raises(DfvsError, match=message):
            bench(tmp_path / f"{name}.npz")
