import argparse
from pathlib import Path

import numpy as np
import pytest
from built_in_room import built_in_room

from dfvs_bench.basin.cells import ROTATIONS_DEG, TRANSLATIONS_M, Cell
from dfvs_bench.basin.drawing import LEAST_OVERLAP, DrawnTask, DrawRequest, draw
from dfvs_bench.basin.environments import Environment
from dfvs_bench.basin.outcomes import draw_tasks
from dfvs_bench.commands.basin import cells_from
from dfvs_bench.trials.executor import TrialExecutor
from dfvs_core.errors import ConfigError
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import pose_error, so3_log
from dfvs_sim.render.truth import visibility
from dfvs_sim.scene import builtin_room_path
from dfvs_sim.viewpoints.free_space import FreeSpace

CAMERA = CameraModel.from_horizontal_fov(80, 60, np.radians(90))
ROOM = Environment("room", builtin_room_path(), CAMERA)
CELLS = (Cell(0.4, (10.0, 10.0, 25.0)), Cell(1.2, (30.0, 30.0, 50.0)))


def poses(task: DrawnTask):
    return np.array(task.start).reshape(4, 4), np.array(task.goal).reshape(4, 4)


@pytest.fixture(scope="module")
def drawn():
    return draw(DrawRequest(ROOM, CELLS, 3, 7))


def test_a_displacement_is_what_its_cell_says(rng):
    for _ in range(20):
        T = Cell(2.0, (20.0, 0.0, 0.0)).displacement(rng)
        assert np.abs(T[:3, 3]).max() == pytest.approx(2.0)
        assert np.abs(so3_log(T[:3, :3])) == pytest.approx([np.radians(20.0), 0.0, 0.0])


def test_every_axis_and_sign_has_its_turn(rng):
    offsets = np.array([Cell(1.0, (0.0, 0.0, 0.0)).displacement(rng)[:3, 3] for _ in range(200)])
    full = np.isclose(np.abs(offsets), 1.0)
    assert (full.sum(axis=0) > 30).all()
    assert np.abs(offsets.mean(axis=0)).max() < 0.2
    poses = [Cell(1.0, (20.0, 0.0, 0.0)).displacement(rng) for _ in range(60)]
    assert 0.2 < np.mean([so3_log(T[:3, :3])[0] > 0 for T in poses]) < 0.8


def test_the_cells_are_the_paper_s():
    assert TRANSLATIONS_M == (0.4, 0.8, 1.2, 1.6, 2.0, 2.4, 2.8, 3.2, 3.6, 4.0)
    assert ROTATIONS_DEG == ((10, 10, 25), (20, 20, 40), (30, 30, 50))


def test_as_many_tasks_are_drawn_freely_as_with_overlap(drawn):
    for cell in CELLS:
        tasks = [task for task in drawn if task.cell == cell]
        assert sum(task.freely for task in tasks) == 3
        assert sum(task.overlaps for task in tasks) == 3
    assert len({task.name for task in drawn}) == len(drawn)


def test_the_overlap_is_that_of_the_two_views(drawn):
    renderer = built_in_room()
    for task in drawn:
        T_start, T_goal = poses(task)
        depths = (renderer.depth(CAMERA, T_goal), renderer.depth(CAMERA, T_start))
        seen = visibility(CAMERA, (T_goal, T_start), depths).mean()
        assert task.overlap == pytest.approx(seen)
        assert task.overlaps == (seen >= LEAST_OVERLAP)


def test_start_and_goal_and_the_way_between_are_free(drawn):
    space = FreeSpace(built_in_room())
    for task in drawn:
        start, goal = (T[:3, 3] for T in poses(task))
        assert min(space.clearance_m(start), space.clearance_m(goal)) >= 0.35
        assert min(space.clearance_m(p) for p in np.linspace(start, goal, 15)) > 0.1


def test_no_way_leads_through_a_wall(monkeypatch):
    """As if a wall stood along north = 0.5 m, and nothing else."""
    monkeypatch.setattr(FreeSpace, "clearance_m", lambda _, point: abs(point[0] - 0.5))
    tasks = draw(DrawRequest(ROOM, (Cell(1.6, (0.0, 0.0, 0.0)),), 12, 7))
    sides = {tuple(T[0, 3] > 0.5 for T in poses(task)) for task in tasks}
    assert sides == {(True, True), (False, False)}


def test_start_and_goal_are_as_far_apart_as_the_cell_says(drawn):
    for task in drawn:
        distance_m, angle_rad = pose_error(*poses(task))
        assert task.cell.translation_m <= distance_m <= 3**0.5 * task.cell.translation_m + 1e-9
        assert np.degrees(angle_rad) > 0.9 * max(task.cell.rotation_deg)


def test_seed_environment_and_cell_alone_decide(drawn):
    alone = draw(DrawRequest(ROOM, CELLS[1:], 3, 7))
    assert alone == tuple(task for task in drawn if task.cell == CELLS[1])
    assert draw(DrawRequest(ROOM, CELLS[1:], 1, 8))[0].start != alone[0].start
    elsewhere = Environment("room-2", ROOM.scene, CAMERA)
    assert draw(DrawRequest(elsewhere, CELLS[1:], 1, 7))[0].start != alone[0].start


def test_tasks_that_are_kept_are_not_drawn_again(tmp_path: Path):
    told: list[str] = []
    request = DrawRequest(ROOM, CELLS[:1], 1, 7)
    once = draw_tasks([request], tmp_path, TrialExecutor(), told.append)
    again = draw_tasks([request], tmp_path, TrialExecutor(), told.append)
    assert again == once
    assert len(told) == 1
    other = draw_tasks([DrawRequest(ROOM, CELLS[:1], 1, 8)], tmp_path, TrialExecutor(), told.append)
    assert other != once
    assert len(told) == 2


@pytest.mark.parametrize("text", ["20,20", "20,20,x", "20,20,nan", "20,20,200"])
def test_a_rotation_set_that_is_none_is_refused(text):
    with pytest.raises(ConfigError):
        cells_from(argparse.Namespace(rotations=[text], translations=None))
