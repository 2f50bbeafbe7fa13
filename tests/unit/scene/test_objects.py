"""Objects that are found in a mesh, and moved in it."""

import numpy as np
from tiny_scenes import scene_of, wall

from dfvs_sim.scene.objects import find_objects, move_vertices


def cube(centre, side_m):
    """Triangles (12, 3, 3) of a cube."""
    faces = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            face = np.roll(np.array([(sign, a, b) for a in (-1, 1) for b in (-1, 1)]), axis, axis=1)
            faces += [face[[0, 1, 2]], face[[1, 2, 3]]]
    return np.array(faces) * side_m / 2 + centre


TABLE, JUG, BALL = cube((0, 0, 0), 1.0), cube((0.2, 0, -0.6), 0.2), cube((3, 0, 0), 0.4)
SCENE = scene_of(np.concatenate([wall(5.0), TABLE, BALL, JUG]))


def test_things_that_touch_are_one_object_and_walls_are_none():
    sizes = sorted((thing.high - thing.low).round(6).tolist() for thing in find_objects(SCENE))
    assert sizes == [[0.4, 0.4, 0.4], [1.0, 1.0, 1.2]]


def test_a_moved_object_takes_its_vertices_along_and_no_other():
    (ball,) = (thing for thing in find_objects(SCENE) if thing.low[0] > 2)
    by_m = np.array([0.0, 0.25, 0.0])
    moved = move_vertices(SCENE, ball.vertices, by_m)
    shift = moved.vertices - SCENE.vertices
    np.testing.assert_allclose(shift[ball.vertices], np.tile(by_m, (len(BALL) * 3, 1)), atol=1e-6)
    assert not np.delete(shift, ball.vertices, axis=0).any()
    there = ball.shifted(by_m)
    assert there.holds(moved.vertices[ball.vertices].astype(float)).all()
    assert not ball.holds(moved.vertices[ball.vertices].astype(float)).all()


def test_a_mesh_in_one_piece_has_no_objects():
    assert find_objects(scene_of(wall(5.0))) == []
