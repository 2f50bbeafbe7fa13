"""The servoing method that the benchmark's page adds."""

import json
import re
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from textured_wall import HEIGHT, WIDTH, Wall, texture, turned
from tiny_scenes import CAMERA, NORTHWARD, scene_of
from tiny_scenes import wall as wall_ahead

from dfvs_bench.methods.method import Decision, GoalObservation, Networks, Observation
from dfvs_bench.methods.registry import METHODS
from dfvs_bench.trials.task import BenchTask
from dfvs_bench.trials.trial import run_trial
from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.errors import ConfigError, GeometryError
from dfvs_core.geometry.camera import CameraModel
from dfvs_models.catalog import load_matcher
from dfvs_sim.render.renderer import Renderer

PAGE = Path(__file__).parents[3] / "docs" / "explanation" / "benchmark.md"
NAME = "flow-servoing"


def test_the_method_of_the_page_knows_its_error_and_the_goal(monkeypatch, rng):
    monkeypatch.setitem(METHODS, NAME, METHODS["pnp"])  # taken out again after the test
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    exec(code, {"__name__": "imported"})
    wall = Wall(texture(rng))
    ones = np.ones((HEIGHT, WIDTH), np.float32)
    depth = DepthMap(2.0 * ones, ones)
    camera = CameraModel.from_horizontal_fov(WIDTH, HEIGHT, 1.57)
    goal = GoalObservation(camera, wall.picture(), depth)
    method = METHODS[NAME].make(goal, load_matcher("classical"), Networks())
    shifted = wall.picture(turned(shift=(-6.0, 0.0)))
    decision = method.decide(Observation(0, shifted, depth, np.eye(4)))
    assert decision.error == pytest.approx(6.0, abs=0.5)
    assert not decision.done
    assert method.decide(Observation(1, goal.image, depth, np.eye(4))).done


def trial_of(T_current_next, error=1.0, lost=""):
    """Trial of two iterations, before a wall, of a method that always decides the same."""

    class Stubborn:
        def decide(self, observation):
            return Decision(T_current_next, error, lost=lost)

    task = BenchTask("wall", Path("wall.glb"), NORTHWARD, NORTHWARD, CAMERA)
    return run_trial(task, Stubborn(), Renderer(scene_of(wall_ahead(2.0))), 2)


def test_the_trial_of_a_method_with_numpys_numbers_can_be_written():
    trial = trial_of(np.eye(4, dtype=np.float32), np.float32(1.5))
    assert trial.final.error == 1.5
    assert "1.5" in json.dumps(asdict(trial))


@pytest.mark.parametrize(
    "wrong",
    [np.zeros((4, 4)), np.zeros(6), np.full((4, 4), np.nan), [["a"]]],
    ids=["zeros", "twist", "NaN", "text"],
)
def test_a_motion_that_is_no_pose_is_an_error_that_names_the_method(wrong):
    with pytest.raises(GeometryError, match="T_current_next of Stubborn"):
        trial_of(wrong)


@pytest.mark.parametrize("wrong", [None, "far", np.zeros(2)])
def test_an_error_that_is_no_number_names_the_method(wrong):
    with pytest.raises(ConfigError, match="error of Stubborn"):
        trial_of(np.eye(4), wrong)


def test_giving_up_without_a_reason_is_an_error_that_names_the_method():
    assert trial_of(np.eye(4), lost="no flow").end == "no flow"
    with pytest.raises(ConfigError, match="lost of Stubborn is True; expected why it gives up"):
        trial_of(np.eye(4), lost=True)
