"""Course: which way the picture says that the camera went."""

import math

import numpy as np
import pytest

from dfvs_core.goal import Mount
from dfvs_core.poses import rotation_from_euler
from dfvs_core.servo.course import Way, course_agreement, follow
from dfvs_core.servo.feature_error import by_cell
from dfvs_core.servo.freedom import level_body, rotate_rays
from dfvs_core.servo.points import ServoPoints

SIZE = 0.04
AHEAD, DOWN = Mount(), Mount(pitch_rad=-math.pi / 2)
STRAIGHT, ASIDE = (0.05, 0.0, 0.0, 0.0), (0.0, -0.05, 0.0, 0.0)
RNG = np.random.default_rng(3)
GRID = np.stack(np.meshgrid(np.linspace(-0.6, 0.6, 24), np.linspace(-0.4, 0.4, 16)), axis=-1)
RAYS = GRID.reshape(-1, 2) + 1e-3
DEPTH_M = RNG.uniform(2.0, 6.0, len(RAYS))
GOAL = RAYS * 0.9 + 0.05 * RNG.normal(size=2)
"""Where the goal picture shows the features that are seen along the rays."""


def moved_rays(mount, moved, tilt=(0.0, 0.0), depth_m=DEPTH_M):
    """Where a camera that is mounted so sees them after the body has moved and tilted."""
    T = mount.T_body_camera()
    R_moved = rotation_from_euler(*tilt, moved[3])
    points = np.column_stack([RAYS, np.ones(len(RAYS))]) * depth_m[:, None]
    body = (points @ T[:3, :3].T + T[:3, 3] - np.array(moved[:3])) @ R_moved
    seen = (body - T[:3, 3]) @ T[:3, :3]
    return seen[:, :2] / seen[:, 2:]


def points(xy, z_m=3.0, keep=slice(None)):
    n = len(xy[keep])
    return ServoPoints(xy[keep], GOAL[keep], np.full(n, z_m), np.ones(n), np.ones(n))


def flown(moved):
    return Way(0, 0.0, np.array(moved[:3]), moved[3])


def agreement(xy, moved, mount=AHEAD, before=RAYS):
    basis = level_body(mount.T_body_camera())
    return course_agreement(by_cell(points(before), SIZE), points(xy), basis, flown(moved))


def turned(degrees, mount=AHEAD):
    return Mount(pitch_rad=mount.pitch_rad, yaw_rad=math.radians(degrees))


@pytest.mark.parametrize("moved", [STRAIGHT, ASIDE, (0.03, 0.02, -0.02, 0.03), (-0.04, 0, 0, 0.07)])
def test_a_camera_mounted_as_configured_agrees(moved):
    """Though its depths are guessed."""
    assert agreement(moved_rays(AHEAD, moved), moved) > 0.97


@pytest.mark.parametrize("moved", [STRAIGHT, ASIDE])
@pytest.mark.parametrize("degrees", [45, 90, 135, 180, -90])
def test_one_that_is_mounted_another_way_round_does_not(moved, degrees):
    found = agreement(moved_rays(turned(degrees), moved), moved)
    assert found == pytest.approx(math.cos(math.radians(degrees)), abs=0.25)


@pytest.mark.parametrize("tilt", [(0.03, 0.0), (0.0, 0.03), (-0.02, -0.03)])
def test_tilt_that_was_taken_level_the_wrong_way_is_no_motion(tilt):
    """Mounted backwards: levelling doubles the tilt instead of taking it away."""
    seen = moved_rays(turned(180), STRAIGHT, tilt)
    R_camera_body = AHEAD.T_body_camera()[:3, :3].T
    R = R_camera_body @ rotation_from_euler(*tilt, 0.0) @ R_camera_body.T
    levelled, _, _ = rotate_rays(R, seen)
    assert agreement(levelled, STRAIGHT) < -0.9


def test_a_camera_that_looks_down_agrees_or_says_nothing():
    found = agreement(moved_rays(DOWN, STRAIGHT), STRAIGHT, DOWN)
    assert found is None or found > 0.9


def test_a_narrow_view_of_the_ground_cannot_tell_tilt_from_way():
    """Seen from above through a long lens both shift the picture."""
    basis, size = level_body(DOWN.T_body_camera()), 0.004
    reference = by_cell(points(0.1 * RAYS), size)
    now = points(0.1 * RAYS + [0.0, 0.05 / 3.0])
    assert course_agreement(reference, now, basis, flown(STRAIGHT)) is None


def test_a_wall_at_a_slant_is_no_other_course():
    """Seen aside, what is near moves further than what is far, as if the camera went ahead."""
    seen = moved_rays(AHEAD, ASIDE, depth_m=4.0 / (1.0 + 1.5 * RAYS[:, 0]))
    narrow = np.abs(RAYS[:, 1]) < 0.1
    basis = level_body(AHEAD.T_body_camera())
    before, now = by_cell(points(RAYS, keep=narrow), SIZE), points(seen, keep=narrow)
    assert course_agreement(before, now, basis, flown(ASIDE)) > 0.9
    assert course_agreement(before, now, basis, flown((0.0, 0.05, 0.0, 0.0))) < -0.9


def test_a_few_wild_features_decide_nothing():
    seen = moved_rays(turned(180), STRAIGHT)
    seen[::6] += RNG.normal(size=(len(seen[::6]), 2))
    assert agreement(seen, STRAIGHT) < -0.95


def test_noise_of_half_a_pixel_decides_nothing():
    noise = 0.5 / 400 * RNG.normal(size=RAYS.shape)
    assert agreement(moved_rays(AHEAD, STRAIGHT) + noise, STRAIGHT) > 0.9


def test_a_short_way_says_nothing():
    for moved in ((0.019, 0.0, 0.0, 0.0), (0.0, 0.0, 0.1, 0.0), (0.0, 0.0, 0.0, 0.5)):
        assert agreement(moved_rays(AHEAD, moved), moved) is None
    assert agreement(moved_rays(AHEAD, (0.021, 0, 0, 0)), (0.021, 0, 0, 0)) is not None


def test_what_is_mostly_a_turn_says_nothing():
    for yaw_rad, says in ((0.099, True), (0.101, False), (-0.101, False)):
        moved = (0.05, 0.0, 0.0, yaw_rad)
        assert (agreement(moved_rays(AHEAD, moved), moved) is not None) is says


def test_little_in_common_says_nothing():
    basis = level_body(AHEAD.T_body_camera())
    before, now = by_cell(points(RAYS), SIZE), moved_rays(AHEAD, STRAIGHT)
    for share, says in ((slice(0, 19), False), (slice(0, 60), True)):
        found = course_agreement(before, points(now, keep=share), basis, flown(STRAIGHT))
        assert (found is not None) is says


def test_what_is_far_from_the_beginning_is_not_asked():
    for length_m, says in ((0.299, True), (0.301, False)):
        moved = (length_m, 0.0, 0.0, 0.0)
        assert (agreement(moved_rays(AHEAD, moved), moved) is not None) is says


def test_a_picture_that_does_not_move_says_nothing():
    assert agreement(RAYS, STRAIGHT) is None


def test_the_way_is_followed_from_its_beginning_on():
    way = follow(None, 5_000_000_000, np.array([9.0, 0.0, 0.0]), 6.2)
    assert (*way.moved_m, way.turned_rad) == (0.0, 0.0, 0.0, 0.0)
    way = follow(way, 5_100_000_000, np.array([0.1, 0.2, -0.1]), 6.3)
    way = follow(way, 5_200_000_000, np.array([0.1, 0.0, 0.0]), 6.4)
    assert (*way.moved_m, way.turned_rad) == pytest.approx((0.02, 0.02, -0.01, 0.2))
    assert follow(way, 5_100_000_000, np.ones(3), 6.4).moved_m == pytest.approx(way.moved_m)
    after_a_pause = follow(way, 65_000_000_000, np.array([0.1, 0.0, 0.0]), 6.4)
    assert after_a_pause.moved_m == pytest.approx([0.07, 0.02, -0.01])


def test_a_picture_that_is_not_clear_about_it_says_nothing():
    """Errors of ten pixels: some hundred such features tell no way of five centimetres."""
    noise = 10.0 / 400 * RNG.normal(size=RAYS.shape)
    assert agreement(moved_rays(AHEAD, STRAIGHT) + noise, STRAIGHT) is None
