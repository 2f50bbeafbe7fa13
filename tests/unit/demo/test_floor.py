"""Where the simulated ground lies in a scene."""

import numpy as np
import pytest
from built_in_room import built_in_room
from tiny_scenes import scene_of, wall

from dfvs_sim.demo.plan import take_off_from_floor
from dfvs_sim.render.renderer import Renderer

FLOOR_M, TABLE_M = 0.3, -0.5


def level(down_m, half_m, north_m=0.0):
    """Corners (2, 3, 3) of a level square that is seen from above."""
    n, s, e = north_m + half_m, north_m - half_m, half_m
    a, b, c, d = (n, -e, down_m), (n, e, down_m), (s, e, down_m), (s, -e, down_m)
    return np.array([[a, b, c], [a, c, d]])


def scene(*parts):
    return Renderer(scene_of(np.concatenate(parts)))


def point(down_m, north_m=0.0):
    return np.array([north_m, 0.0, down_m])


def test_a_table_is_no_floor():
    room = scene(level(FLOOR_M, 5.0), level(TABLE_M, 0.6))
    take_off = take_off_from_floor(room, [point(-1.2)])
    assert take_off.height_m == pytest.approx(1.2 + FLOOR_M, abs=0.01)


def test_the_take_off_is_the_start_s_height_above_the_floor():
    take_off = take_off_from_floor(scene(level(FLOOR_M, 5.0)), [point(-1.0), point(0.0)])
    assert take_off.height_m == pytest.approx(1.3, abs=1e-3)
    assert not take_off.remark


def test_the_ground_is_the_lowest_floor_on_the_way():
    room = scene(level(FLOOR_M, 4.0), level(FLOOR_M + 0.8, 4.0, north_m=8.5))
    take_off = take_off_from_floor(room, [point(-1.0), point(-1.0, north_m=9.0)])
    assert take_off.height_m == pytest.approx(2.1, abs=0.01)


def test_without_a_floor_the_usual_height_is_taken_and_told():
    take_off = take_off_from_floor(scene(wall(3.0, 1.0, 0.1)), [point(-1.0)])
    assert take_off.height_m == 1.5
    assert "no floor" in take_off.remark


@pytest.mark.parametrize(("down_m", "height_m"), [(FLOOR_M - 0.2, 0.5), (FLOOR_M - 50.0, 20.0)])
def test_a_height_that_nobody_takes_off_to_is_bounded_and_told(down_m, height_m):
    take_off = take_off_from_floor(scene(level(FLOOR_M, 500.0)), [point(down_m)])
    assert take_off.height_m == height_m
    assert "above the scene's floor" in take_off.remark


def test_the_built_in_room_stands_on_its_floor():
    room = built_in_room()
    assert take_off_from_floor(room, [point(-1.3)]).height_m == pytest.approx(1.3, abs=0.02)
