"""The servoing method that the benchmark's page adds."""

import re
from pathlib import Path

import numpy as np
import pytest
from textured_wall import HEIGHT, WIDTH, Wall, texture, turned

from dfvs_bench.methods.method import GoalObservation, Networks, Observation
from dfvs_bench.methods.registry import METHODS
from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.geometry.camera import CameraModel
from dfvs_models.catalog import load_matcher

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
