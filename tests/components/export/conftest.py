"""Pairs of views to train on."""

import pytest

from dfvs_rooms.pairs.files import write_arrays
from dfvs_rooms.pairs.wide import WidePairSampler
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene import builtin_room_path
from dfvs_sim.scene.glb import load_glb


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """A handful of the built-in room."""
    out = tmp_path_factory.mktemp("pairs")
    sampler = WidePairSampler(Renderer(load_glb(builtin_room_path())), 3)
    write_arrays(out / "room.npz", sampler.arrays(4))
    return out
