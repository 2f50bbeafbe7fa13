import argparse
import json

import numpy as np
import pytest

from dfvs_core.errors import DfvsError
from dfvs_core.pair_files import shard_name
from dfvs_models.evaluation_file import read_flow_pairs
from dfvs_sim.commands import pairs
from dfvs_sim.scene import builtin_room_path


def run(*words):
    parser = argparse.ArgumentParser()
    pairs.add_parser(parser.add_subparsers())
    args = parser.parse_args(["pairs", *map(str, words)])
    return args.run(args)


def test_an_evaluation_file_takes_the_levels_in_turn(tmp_path, capsys):
    out = tmp_path / "room.npz"
    words = ["--format", "eval", "--scene", builtin_room_path(), "--count", "4", "--seed", "9"]
    assert run(*words, "--out", out, "--json") == 0
    assert json.loads(capsys.readouterr().out) == {"pairs": 4, "files": [str(out)]}
    made = read_flow_pairs(out)
    assert made.current.shape == (4, 240, 320, 3)
    np.testing.assert_array_equal(made.level, [0, 1, 2, 0])
    first = out.read_bytes()
    run(*words, "--out", out)
    assert out.read_bytes() == first


def test_shards_of_a_drawn_room_are_filled_and_numbered_by_their_seed(tmp_path):
    words = ["--rooms", "3", "--kinds", "corridor", "--size", "48x36", "--count", "1"]
    assert run(*words, "--seed", "12", "--out", tmp_path / "pairs") == 0
    (path,) = (tmp_path / "pairs").iterdir()
    assert path.name == shard_name((48, 36), 12) == "shard-48x36-00000012.npz"
    with np.load(path) as arrays:
        assert len(arrays["images"]) == 64


def test_seeds_draw_among_the_kinds_that_are_named(monkeypatch):
    made = []
    monkeypatch.setattr(pairs, "room_of_kind", lambda kind, seed: made.append((kind, seed)))
    kinds = ("kitchen", "courtyard", "study")
    for seed in range(40):
        pairs._room(seed, kinds)
    assert [seed for _, seed in made] == list(range(40))
    assert {kind for kind, _ in made} == set(kinds)


@pytest.mark.parametrize(
    ("words", "match"),
    [
        (["--rooms", "5-4"], "--rooms is '5-4'"),
        (["--rooms", "five"], "--rooms is 'five'; expected seeds such as 1000-1031"),
        (["--rooms", "5", "--count", "0"], "--count is 0"),
        (["--rooms", "5", "--seed", "-1"], "--seed is -1"),
        (["--rooms", "5", "--size", "small"], "--size is 'small'"),
        (["--rooms", "5", "--size", "10x10"], "image size 10 x 10"),
        (["--scene", "none.glb"], "none.glb cannot be read"),
        (["--scene", "none.glb", "--kinds", "hall"], "--kinds was given with --scene"),
        (["--rooms", "5", "--kinds", "hall,cave"], "no kind of room 'cave'"),
        (
            ["--rooms", "3990-4001"],
            "--rooms is '3990-4001'; expected other seeds than 4000 to 4199",
        ),
        (["--rooms", "5", "--format", "eval", "--out", "pairs"], "an .npz file"),
        (["--rooms", "5", "--format", "eval", "--out", "no/x.npz"], "an existing folder"),
        (["--rooms", "5", "--format", "eval", "--size", "64x48", "--out", "x.npz"], "no --size"),
    ],
)
def test_says_what_is_wrong_and_writes_nothing(tmp_path, monkeypatch, words, match):
    monkeypatch.chdir(tmp_path)
    usual = ["--count", "2", "--seed", "1", "--out", "out"]
    with pytest.raises(DfvsError, match=match):
        run(*usual, *words)
    assert not [p for p in tmp_path.rglob("*") if p.is_file()]
