"""Compile the kernels (or load them from the cache) before the clock of a test runs."""

import pytest
from tiny_scenes import CAMERA, NORTHWARD, scene_of, wall

from dfvs_sim.render.renderer import Renderer


@pytest.fixture(scope="session", autouse=True)
def compiled_kernels():
    renderer = Renderer(scene_of(wall(2.0)))
    for antialias in (False, True):
        renderer.render(CAMERA, NORTHWARD, antialias)
