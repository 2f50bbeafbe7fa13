"""What perturbations do to frames and scenes: as much as their strength says, and by the seed."""

from dataclasses import replace

import numpy as np
import pytest
from tiny_scenes import scene_of, wall

from dfvs_bench.trials.perturbation import (
    KINDS,
    NOISE,
    OCCLUDED,
    STRENGTHS,
    Perturbation,
    check_perturbations,
    disturbance,
    parse_perturbations,
    perturbed_renderer,
)
from dfvs_bench.trials.scenes import default_tasks
from dfvs_core.errors import ConfigError
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene.glb import load_glb
from dfvs_sim.scene.glb_writer import save_glb
from dfvs_sim.scene.mesh import SceneError

TASK = next(task for task in default_tasks() if task.name == "hall")


@pytest.fixture(scope="module")
def room():
    return Renderer(load_glb(TASK.scene))


def goal_view(renderer):
    return renderer.render(TASK.camera, TASK.T_world_goal, antialias=True)


def frame(room, perturbation, index=0, task=TASK):
    renderer = perturbed_renderer(perturbation, task, room)
    return disturbance(perturbation, task)(index, goal_view(renderer))


@pytest.mark.parametrize("kind", KINDS)
def test_the_seed_decides_on_every_frame_and_more_strength_changes_more(room, kind):
    clean = goal_view(room).image.astype(float)
    changes = []
    for strength in STRENGTHS:
        image = frame(room, Perturbation(kind, strength), 5).image
        assert (image == frame(room, Perturbation(kind, strength), 5).image).all()
        changes.append(float(np.abs(image - clean).mean()))
    assert 0.0 < changes[0] < changes[1] < changes[2]
    if kind != "blur":
        other = frame(room, Perturbation(kind, "strong"), 5, replace(TASK, seed=1)).image
        assert (other != image).any()


@pytest.mark.parametrize("strength", STRENGTHS)
def test_the_occluder_moves_and_hides_as_much_as_it_says_from_the_depth_sensor_too(room, strength):
    clean = goal_view(room)
    views = [frame(room, Perturbation("occlusion", strength), k) for k in (0, 40)]
    hidden = [view.depth_m < clean.depth_m for view in views]
    assert [h.mean() for h in hidden] == pytest.approx([OCCLUDED[strength]] * 2, rel=0.01)
    assert (hidden[0] != hidden[1]).any()
    assert (views[0].image[~hidden[0]] == clean.image[~hidden[0]]).all()


def test_noise_has_its_deviation_and_is_fresh_in_every_frame(room):
    clean = goal_view(room).image
    inside = (clean > 60) & (clean < 195)  # far from where grey levels end
    first, second = (frame(room, Perturbation("noise"), k).image.astype(float) for k in (0, 1))
    for difference in (first - clean, (first - second) / np.sqrt(2)):
        assert difference[inside].std() == pytest.approx(NOISE["medium"], rel=0.05)


def test_moved_objects_leave_the_line_from_start_to_goal_free(room):
    moved = perturbed_renderer(Perturbation("moved", "strong"), TASK, room).scene
    changed = (moved.vertices != room.scene.vertices).any(axis=1)
    start, goal = TASK.T_world_start[:3, 3], TASK.T_world_goal[:3, 3]
    for place in np.linspace(start, goal, 9):
        assert np.linalg.norm(moved.vertices[changed] - place, axis=1).min() > 0.25
    assert (moved.vertices[:, 2] == room.scene.vertices[:, 2]).all()


def test_a_scene_without_objects_is_refused_before_any_trial(tmp_path):
    save_glb(tmp_path / "wall.glb", scene_of(wall(3.0)))
    task = replace(TASK, name="bare", scene=tmp_path / "wall.glb")
    check_perturbations(parse_perturbations("light,blur,occlusion,noise"), [task])
    with pytest.raises(SceneError, match="'bare' shows no object"):
        check_perturbations(parse_perturbations("light,moved"), [task])


def test_names_are_kinds_with_or_without_a_strength():
    found = parse_perturbations("light,noise-strong,light-medium")
    assert found == [Perturbation("light", "medium"), Perturbation("noise", "strong")]
    assert [p.name for p in found] == ["light-medium", "noise-strong"]
    for names in ("fog", "", "light,,blur", "blur-huge"):
        with pytest.raises(ConfigError, match="there is no perturbation"):
            parse_perturbations(names)
