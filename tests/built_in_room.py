"""The room that comes with the simulator, read once for all tests of a process."""

import functools

from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene import builtin_room_path
from dfvs_sim.scene.glb import load_glb


@functools.cache
def built_in_room() -> Renderer:
    return Renderer(load_glb(builtin_room_path()))
