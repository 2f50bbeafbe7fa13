from dataclasses import replace

import cv2
import numpy as np
import pytest
from built_in_room import built_in_room

from dfvs_bench.report.paper import paper_scenes
from dfvs_bench.trials import scenes
from dfvs_bench.trials.scenes import CAMERA, SCENES, SceneSpec, default_tasks, make_scenes, task_in
from dfvs_bench.trials.task import read_tasks
from dfvs_bench.trials.task_sampling import TaskConstraints, draw_task
from dfvs_core.geometry.poses import pose_error
from dfvs_rooms.generator.splits import BENCHMARK_SEEDS
from dfvs_rooms.lighting.path_traced import BakeSettings
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.render.truth import visibility
from dfvs_sim.scene import builtin_room_path
from dfvs_sim.scene.glb import load_glb
from dfvs_sim.scene.mesh import SceneError
from dfvs_sim.viewpoints.free_space import FreeSpace

PLACING = TaskConstraints(1.2, np.radians(18.0), (0.4, 0.8), 60)
SMALL = SceneSpec("small", "living-room", 7, "easy", 0.8, 12.0)


@pytest.fixture(scope="module")
def room():
    return built_in_room()


def test_a_drawn_task_is_what_was_asked_for(room):
    T_start, T_goal = draw_task(room, CAMERA, PLACING, np.random.default_rng(1))
    distance_m, angle_rad = pose_error(T_start, T_goal)
    assert distance_m == pytest.approx(1.2, abs=1e-9)
    assert angle_rad == pytest.approx(np.radians(18.0), abs=1e-9)
    depths = (room.depth(CAMERA, T_goal), room.depth(CAMERA, T_start))
    assert 0.4 <= visibility(CAMERA, (T_goal, T_start), depths).mean() <= 0.8
    space = FreeSpace(room)
    way = np.linspace(T_start[:3, 3], T_goal[:3, 3], 20)
    assert min(space.clearance_m(stop) for stop in way) > 0.15


def test_the_seed_alone_decides(room):
    one, two = (draw_task(room, CAMERA, PLACING, np.random.default_rng(2)) for _ in range(2))
    np.testing.assert_array_equal(one, two)
    other = draw_task(room, CAMERA, PLACING, np.random.default_rng(3))
    assert not np.array_equal(one, other)


def test_a_task_that_does_not_fit_is_none(room, monkeypatch):
    monkeypatch.setattr("dfvs_bench.trials.task_sampling._GOALS_TRIED", 20)
    constraints = TaskConstraints(30.0, 0.1, (0.4, 0.8), 60)
    assert draw_task(room, CAMERA, constraints, np.random.default_rng(1)) is None


def test_a_scan_with_holes_has_tasks_too(room, monkeypatch):
    monkeypatch.setattr("dfvs_bench.trials.task_sampling._GOALS_TRIED", 150)
    scene = room.scene
    kept = np.random.default_rng(5).random(len(scene.triangles)) > 0.02
    holes = replace(scene, triangles=scene.triangles[kept], texture_index=scene.texture_index[kept])
    scan = Renderer(holes)
    strict, lenient = PLACING, replace(PLACING, most_empty=0.1)
    assert draw_task(scan, CAMERA, strict, np.random.default_rng(1)) is None
    T_start, _ = draw_task(scan, CAMERA, lenient, np.random.default_rng(1))
    assert 0.0 < (scan.depth(CAMERA, T_start) <= 0.0).mean() <= 0.1


def test_a_scene_without_any_place_for_a_task_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("dfvs_bench.trials.task_sampling._GOALS_TRIED", 0)
    (tmp_path / "bare.glb").write_bytes(builtin_room_path().read_bytes())
    with pytest.raises(SceneError, match=r"1\.5 m and 20 degrees found in .*bare\.glb.*--tasks"):
        task_in(tmp_path / "bare.glb")


def test_the_ten_start_as_far_away_as_the_paper_s():
    assert [(s.distance_m, s.angle_deg) for s in SCENES] == [p.initial for p in paper_scenes()]
    difficulties = [spec.difficulty for spec in SCENES]
    assert [difficulties.count(d) for d in ("easy", "medium", "hard")] == [3, 4, 3]
    assert len({spec.name for spec in SCENES}) == len({spec.seed for spec in SCENES}) == 10
    assert len({spec.kind for spec in SCENES}) == 10


@pytest.mark.parametrize(("spec", "task"), list(zip(SCENES, default_tasks(), strict=True)))
def test_the_scenes_that_come_with_the_package_are_what_their_specs_say(spec, task):
    assert (task.name, task.difficulty, task.seed) == (spec.name, spec.difficulty, spec.seed)
    assert task.initial_error == pytest.approx((spec.distance_m, np.radians(spec.angle_deg)))
    assert task.camera == CAMERA
    assert task.scene.name.startswith(f"{spec.kind}-{spec.seed}-traced")
    scene = Renderer(load_glb(task.scene))
    poses = (task.T_world_start, task.T_world_goal)
    start, goal = (scene.render(CAMERA, T) for T in poses)
    least, most = spec.constraints.overlap
    assert least <= visibility(CAMERA, poses[::-1], (goal.depth_m, start.depth_m)).mean() <= most
    sift = cv2.SIFT.create(nfeatures=2000)
    for view in (start, goal):
        grey = cv2.cvtColor(view.image, cv2.COLOR_RGB2GRAY)
        # drawn in quick light; in that which ships a few points come and go
        assert len(sift.detect(grey, None)) >= 0.8 * spec.constraints.features


def test_no_scene_is_one_that_a_network_was_trained_or_measured_on():
    measured = {("lounge", 22), ("study", 2), ("hall", 3)}
    assert {spec.seed for spec in SCENES} <= set(BENCHMARK_SEEDS)
    assert not measured & {(spec.kind, spec.seed) for spec in SCENES}


def test_a_room_that_is_there_is_kept(tmp_path, monkeypatch):
    (tmp_path / "living-room-7.glb").write_bytes(builtin_room_path().read_bytes())
    monkeypatch.setattr(scenes, "light_room", lambda *_: pytest.fail("made again"))
    told = []
    (task,) = make_scenes(tmp_path, (SMALL,), told.append)
    assert told == ["small: living-room from seed 7"]
    (read,) = read_tasks(tmp_path / "tasks.json")
    assert read.difficulty == "easy"
    np.testing.assert_allclose(read.T_world_start, task.T_world_start, atol=1e-12)
    assert task.initial_error == pytest.approx((0.8, np.radians(12.0)))


def test_traced_light_changes_the_scene_and_not_the_task(tmp_path, monkeypatch, room):
    (tmp_path / "living-room-7.glb").write_bytes(builtin_room_path().read_bytes())
    monkeypatch.setattr(
        scenes, "bake_room", lambda _room, settings, _told: asked.append(settings) or room.scene
    )
    asked = []
    (quick,) = make_scenes(tmp_path, (SMALL,), lambda _: None)
    (traced,) = make_scenes(tmp_path, (SMALL,), lambda _: None, BakeSettings(samples=32))
    assert [settings.samples for settings in asked] == [32]
    assert traced.scene.name == "living-room-7-traced-32.glb"
    assert traced.scene.is_file()
    np.testing.assert_array_equal(traced.T_world_start, quick.T_world_start)
    (read,) = read_tasks(tmp_path / "tasks.json")
    assert read.scene.name == traced.scene.name
