import json
import weakref

import numpy as np
import pytest
from subcommand import run_subcommand
from tiny_scenes import GlbFile

from dfvs_core.errors import DfvsError
from dfvs_models.evaluation_file import read_flow_pairs
from dfvs_rooms.commands import pairs
from dfvs_sim.scene import builtin_room_path


def run(*words):
    return run_subcommand(pairs, *words)


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


def test_rooms_take_turns_and_one_at_a_time_is_in_memory(tmp_path, monkeypatch):
    alive, most, written = weakref.WeakSet(), [], []

    class Sampler:
        """Knows its room; draws pairs that say it."""

        def __init__(self, room):
            self.room = room
            alive.add(self)

        def evaluation_pair(self, level, rng):
            most.append(len(alive))
            return self.room, level

    monkeypatch.setattr(pairs, "_lit_room", lambda seed, kinds: seed)
    monkeypatch.setattr(pairs, "Renderer", lambda scene: scene)
    monkeypatch.setattr(pairs, "PairSampler", Sampler)
    monkeypatch.setattr(pairs, "evaluation_arrays", lambda pairs, levels: pairs)
    monkeypatch.setattr(pairs, "write_arrays", lambda path, arrays: written.extend(arrays))
    out = tmp_path / "rooms.npz"
    run("--rooms", "5-7", "--count", "16", "--seed", "1", "--out", out)
    assert [room for room, _ in written] == [5, 5, 5, 6, 6, 6, 7, 7, 7, 5, 5, 5, 6, 6, 6, 7]
    assert [level for _, level in written] == [*["small", "medium", "large"] * 5, "small"]
    assert max(most) == 1


def test_wide_pairs_are_a_file_a_room_and_kept_where_they_exist(tmp_path, capsys):
    out = tmp_path / "pairs"
    words = ["--format", "wide", "--rooms", "30003", "--kinds", "corridor", "--count", "2"]
    assert run(*words, "--seed", "12", "--out", out) == 0
    (path,) = out.iterdir()
    assert path.name == "30003.npz"
    first = path.read_bytes()
    with np.load(path) as arrays:
        assert arrays["T"].shape == (2, 4, 4)
        assert arrays["D"].shape == (2, 2, 240, 320)
        assert {"a0", "b0", "a1", "b1"} <= set(arrays)
    assert run(*words, "--seed", "13", "--out", out) == 0
    told = capsys.readouterr()
    assert "wrote 0 pairs" in told.out
    assert f"1 files in {out} are kept" in told.err
    assert path.read_bytes() == first


def test_a_room_without_a_pair_is_named_and_gets_no_file(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("dfvs_rooms.pairs.wide._PLACES_TRIED", 20)  # 3000 take 15 s
    file = GlbFile()
    a, b, c, d = ((x, 0.0, z) for x, z in ((-0.1, -0.1), (-0.1, 0.1), (0.1, 0.1), (0.1, -0.1)))
    file.triangle((a, b, c))
    file.triangle((a, c, d))
    file.triangle(((-0.4, 0.0, 0.0), (0.4, 0.0, 0.0), (0.0, 3.0, 0.0)))  # no place is clear of it
    scene = file.write(tmp_path / "shaft.glb")
    out = tmp_path / "pairs"
    words = ["--format", "wide", "--scene", scene, "--count", "2", "--seed", "1", "--out", out]
    assert run(*words) == 0
    told = capsys.readouterr()
    assert "no pair of views was found in shaft" in told.err
    assert "wrote 0 pairs in 0 files" in told.out
    assert list(out.iterdir()) == []


def test_seeds_draw_among_the_kinds_that_are_named(monkeypatch):
    made = []
    monkeypatch.setattr(pairs, "room_of_kind", lambda kind, seed: made.append((kind, seed)))
    monkeypatch.setattr(pairs, "light_room", lambda room, seed: None)
    kinds = ("kitchen", "courtyard", "study")
    for seed in range(40):
        pairs._lit_room(seed, kinds)
    assert [seed for _, seed in made] == list(range(40))
    assert {kind for kind, _ in made} == set(kinds)


@pytest.mark.parametrize(
    ("words", "match"),
    [
        (["--rooms", "5-4"], "--rooms is '5-4'"),
        (["--rooms", "five"], "--rooms is 'five'; expected seeds such as 1000-1031"),
        (["--rooms", "5", "--count", "0"], "--count is 0"),
        (["--rooms", "5", "--seed", "-1"], "--seed is -1"),
        (["--rooms", "8001", "--format", "wide"], "rooms 8001 to 8001 to train on"),
        (["--scene", "none.glb"], "none.glb cannot be read"),
        (["--scene", "a/room.glb", "b/room.glb"], "scenes are named room, room; expected names"),
        (["--scene", "none.glb", "--kinds", "hall"], "--kinds was given with --scene"),
        (["--rooms", "5", "--kinds", "hall,cave"], "no kind of room 'cave'"),
        (
            ["--rooms", "3990-4001"],
            "--rooms is '3990-4001'; expected other seeds than 4000 to 4199",
        ),
        (["--rooms", "5", "--out", "pairs"], "an .npz file"),
        (["--rooms", "5", "--format", "eval", "--out", "no/x.npz"], "an existing folder"),
    ],
)
def test_says_what_is_wrong_and_writes_nothing(tmp_path, monkeypatch, words, match):
    monkeypatch.chdir(tmp_path)
    usual = ["--count", "2", "--seed", "1", "--out", "out.npz"]
    with pytest.raises(DfvsError, match=match):
        run(*usual, *words)
    assert not [p for p in tmp_path.rglob("*") if p.is_file()]
