import pytest

from dfvs_bench.basin import environments
from dfvs_bench.basin.environments import default_environments, make_missing
from dfvs_bench.trials.scenes import SCENES
from dfvs_rooms.generator.splits import BENCHMARK_SEEDS
from dfvs_rooms.room_types.room_types import ROOM_KINDS


def split(place):
    kind, _, seed = place.name.rpartition("-")
    return kind, int(seed)


@pytest.fixture
def rooms(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return default_environments()


def test_a_batch_is_sixteen_rooms_of_all_kinds(rooms):
    assert len({place.name for place in rooms}) == 16
    assert {kind for kind, _ in map(split, rooms)} == set(ROOM_KINDS)


def test_no_room_is_one_of_the_ten_scenes_or_may_be_trained_on(rooms):
    seeds = {seed for _, seed in map(split, rooms)}
    assert seeds <= set(BENCHMARK_SEEDS)
    assert not seeds & {spec.seed for spec in SCENES}


def test_only_rooms_that_are_missing_are_made(rooms, monkeypatch):
    told = []
    monkeypatch.setattr(environments, "light_room", lambda room, seed: (room, seed))
    monkeypatch.setattr(environments, "room_of_kind", lambda kind, seed: kind)
    monkeypatch.setattr(environments, "save_glb", lambda path, scene: path.write_text(str(scene)))
    first, second = rooms[:2]
    make_missing([first], told.append)
    assert first.scene.read_text() == str(split(first))
    make_missing([first, second], told.append)
    assert second.scene.read_text() == str(split(second))
    assert len(told) == 2
    assert list(first.scene.parent.glob("*.part.glb")) == []
