"""The mounting's check: images must turn as the gyroscopes do."""

import numpy as np
import pytest

from dfvs_core.geometry.camera import CameraModel, homogeneous
from dfvs_core.geometry.poses import invert_pose, make_pose, rotation_from_euler
from dfvs_core.matching.correspondence import empty_flow
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_core.servo.checks.image_turn import PointTracks, image_turn, point_tracks
from dfvs_core.servo.checks.motion_monitor import MotionMeasures
from dfvs_core.servo.checks.mounting import (
    MOST_SCORE,
    MountingState,
    begin_mounting,
    follow_mounting,
    mounting_score,
    probing_velocity,
)
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.exchange import Attitude, ServoInputs
from dfvs_core.servo.goal_filter import SCALE_SPREAD, PositionMeasurement, begin
from dfvs_core.servo.points import GridSamples
from dfvs_core.servo.step import _probed
from dfvs_core.servo.task import ServoTask

CAMERA = CameraModel.from_horizontal_fov(160, 120, np.radians(75))
STRIDE = 8
PERIOD_S = 1.0 / 15.0
DEPTH_M = 3.0
ASSUMED = Mount()
DOWN = Mount(pitch_rad=np.radians(-90.0))


def depth_of(T_wall_camera):
    """Depth (h, w) of a wall in the plane z = DEPTH_M of a frame, and its points (h, w, 3)."""
    xy = CAMERA.normalise(CAMERA.grid(STRIDE))
    directions = homogeneous(xy) @ T_wall_camera[:3, :3].T
    z = (DEPTH_M - T_wall_camera[2, 3]) / directions[..., 2]
    return z, T_wall_camera[:3, 3] + directions * z[..., None]


def samples_from(T_wall_camera, noise_px=0.0, rng=None):
    """Flow of a view of the wall to the view from the origin."""
    pixels = CAMERA.grid(STRIDE)
    flow = CAMERA.project(depth_of(T_wall_camera)[1]) - pixels
    if noise_px:
        flow = flow + noise_px * rng.normal(size=flow.shape)
    return GridSamples(pixels, flow, np.ones(flow.shape[:2]))


def tracks_of(before, now, z):
    return point_tracks((before, now), z, (CAMERA, CAMERA), 0.1)


def turn_between(before, now, z=None, **noise):
    z = depth_of(now)[0] if z is None else z
    return image_turn(tracks_of(samples_from(before, **noise), samples_from(now, **noise), z))


# --- turn of the camera ---------------------------------------------------------------------

SMALL = make_pose(rotation_from_euler(0.004, -0.006, 0.003), np.array([0.01, -0.02, 0.015]))
TURN = make_pose(rotation_from_euler(0.0, 0.0, 0.01), np.zeros(3))


def test_the_turn_between_two_frames_is_found_beside_their_translation():
    before = make_pose(rotation_from_euler(0.02, 0.05, -0.03), np.array([0.1, 0.05, -0.4]))
    turn = turn_between(before, before @ SMALL)
    np.testing.assert_allclose(turn.vector_rad, [0.004, -0.006, 0.003], atol=2e-4)


def test_a_wide_lens_s_distortion_does_not_hide_a_turn():
    lens = CameraModel(160, 120, 100.0, 100.0, 80.0, 60.0, (-0.2, 0.05, 0.0, 0.0))
    pixels = lens.grid(STRIDE)
    points = DEPTH_M * homogeneous(lens.normalise(pixels))
    depth = points[..., 2]

    def view(T):
        seen = points @ T[:3, :3].T + T[:3, 3]
        seen = seen * (DEPTH_M / seen[..., 2:])
        return GridSamples(pixels, lens.project(seen) - pixels, np.ones(depth.shape))

    step = make_pose(rotation_from_euler(0.004, -0.006, 0.003), np.zeros(3))
    tracks = point_tracks((view(np.eye(4)), view(step)), depth, (lens, lens), 0.1)
    np.testing.assert_allclose(image_turn(tracks).vector_rad, [0.004, -0.006, 0.003], atol=4e-4)


def test_a_depth_in_another_unit_changes_no_turn():
    z = 0.2 * depth_of(SMALL)[0]
    near, far = turn_between(np.eye(4), SMALL), turn_between(np.eye(4), SMALL, z)
    np.testing.assert_allclose(near.vector_rad, far.vector_rad, atol=1e-9)


def test_the_stated_covariance_of_a_turn_is_that_of_its_errors():
    rng = np.random.default_rng(5)
    errors, variances = [], []
    for _ in range(60):
        turn = turn_between(np.eye(4), SMALL, noise_px=0.3, rng=rng)
        errors.append(turn.vector_rad - [0.004, -0.006, 0.003])
        variances.append(np.diag(turn.covariance))
    ratio = np.mean(np.square(errors), axis=0) / np.mean(variances, axis=0)
    # Errors of neighbours are told to be alike, and here they are not: nine times too large.
    assert (ratio > 0.5 / 9.0).all()
    assert (ratio < 2.0 / 9.0).all()


@pytest.mark.parametrize("yaw_deg", [-25.0, 25.0])
def test_the_stated_covariance_holds_for_a_depth_that_is_a_guess(yaw_deg):
    """It is 3 m everywhere, while the wall leans."""
    rng = np.random.default_rng(6)
    R = rotation_from_euler(0.0, np.radians(yaw_deg), 0.0)  # in the camera's axes: about its y
    guess = np.full((15, 20), DEPTH_M)
    errors = []
    for _ in range(60):
        before = make_pose(R, np.array([0.1, 0.05, 0.4]))
        vector = 0.005 * rng.normal(size=3)
        step = make_pose(rotation_from_euler(*vector), 0.03 * rng.normal(size=3))
        turn = turn_between(before, before @ step, guess, noise_px=0.1, rng=rng)
        off = turn.vector_rad - vector
        errors.append(off @ np.linalg.solve(turn.covariance, off) / 3.0)
    assert np.mean(errors) < 2.0


def test_points_that_go_their_own_way_do_not_turn_the_camera():
    tracks = tracks_of(samples_from(np.eye(4)), samples_from(SMALL), depth_of(SMALL)[0])
    shift = tracks.shift.copy()
    shift[:40] += 0.05
    wrong = PointTracks(tracks.xy, tracks.z, shift, tracks.slope)
    np.testing.assert_allclose(
        image_turn(wrong).vector_rad, image_turn(tracks).vector_rad, atol=2e-4
    )


def pillared(T_wall_camera):
    """Flow of a view of a wall with pillars a third as far before it, and its depth (h, w)."""
    pixels = CAMERA.grid(STRIDE)
    z = np.full(pixels.shape[:2], DEPTH_M)
    z[:, 3::7] = z[:, 4::7] = DEPTH_M / 3.0
    points = homogeneous(CAMERA.normalise(pixels)) * z[..., None]
    points = points @ T_wall_camera[:3, :3].T + T_wall_camera[:3, 3]
    return GridSamples(pixels, CAMERA.project(points) - pixels, np.ones(z.shape)), z


def test_edges_of_depth_do_not_hide_a_turn():
    """There the slope is large and wrong; a robust fit that begins at no turn would keep it."""
    before = make_pose(rotation_from_euler(0.0, 0.2, 0.0), np.array([0.3, 0.1, -0.4]))
    (first, _), (second, z) = pillared(before), pillared(before @ TURN)
    tracks = tracks_of(first, second, z)
    assert len(tracks.xy) < 0.6 * z.size
    assert np.abs(tracks.slope).max() < 3.0


def test_points_without_sure_neighbours_do_not_count():
    before, now = samples_from(np.eye(4)), samples_from(SMALL)
    now.confidence[5, 5] = 0.0
    count = len(tracks_of(before, now, depth_of(SMALL)[0]).xy)
    rows, columns = now.confidence.shape
    assert count == (rows - 2) * (columns - 2) - 5


def test_few_points_tell_no_turn():
    before, now = samples_from(np.eye(4)), samples_from(SMALL)
    now.confidence[3:] = 0.0
    assert image_turn(tracks_of(before, now, depth_of(SMALL)[0])) is None


# --- regression -----------------------------------------------------------------------------


def scores_of(angles_rad, positions_m, mounted, mount=ASSUMED, noise_deg=0.0):
    """Scores after each frame of a vehicle with roll and pitch (n, 2) at these places (n, 3).

    ``mounted`` is where the camera truly sits, (4, 4) in the body, and ``mount`` where it is said.
    """
    rng = np.random.default_rng(1)
    state, before, found = None, None, []
    for k, (angles, position) in enumerate(zip(angles_rad, positions_m, strict=True)):
        T = make_pose(rotation_from_euler(*angles, 0.0), position) @ mounted
        T = invert_pose(mounted) @ T
        measured = angles + np.radians(noise_deg) * rng.normal(size=2)
        now = begin_mounting(round(k * PERIOD_S * 1e9), rotation_from_euler(*measured, 0.0))
        if state is None:
            state = now
        else:
            turn = turn_between(before, T, noise_px=0.1, rng=rng)
            state = follow_mounting(state, now, turn, mount.T_body_camera()[:3, :3])
        before = T
        found.append(mounting_score(state))
    return found


def scores(
    mounted_deg,
    tilt_deg,
    velocity=(0.0, 0.0, 0.0),
    seconds=4.0,
    noise_deg=0.0,
    mount=ASSUMED,
    mounted=None,
):
    """Scores after each frame of a vehicle that rolls and pitches to and fro while it moves."""
    t = np.arange(round(seconds / PERIOD_S)) * PERIOD_S
    angles = np.radians(tilt_deg) * np.stack([np.sin(5.0 * t), np.sin(3.3 * t + 1.0)], axis=1)
    turned = make_pose(rotation_from_euler(0.0, 0.0, np.radians(mounted_deg)), np.zeros(3))
    mounted = turned @ mount.T_body_camera() if mounted is None else mounted
    return scores_of(angles, np.outer(t, velocity), mounted, mount, noise_deg)


def score_of(*args, **kwargs):
    return scores(*args, **kwargs)[-1]


def test_a_camera_that_is_mounted_as_said_is_known_by_its_tilt():
    assert score_of(0.0, tilt_deg=1.0) > 10.0


@pytest.mark.parametrize("mounted_deg", [180.0, 90.0, -90.0, 120.0])
def test_a_camera_that_is_mounted_another_way_round_is_known_too(mounted_deg):
    assert score_of(mounted_deg, tilt_deg=1.0) < -10.0


@pytest.mark.parametrize("mounted_deg", [180.0, 90.0, -90.0])
def test_a_camera_that_looks_down_is_known_as_well(mounted_deg):
    assert score_of(0.0, tilt_deg=1.0, mount=DOWN) > 5.0
    assert score_of(mounted_deg, tilt_deg=1.0, mount=DOWN) < -5.0


@pytest.mark.parametrize("tilt_deg", [(1.0, 1.0), (4.0, 0.5), (0.5, 4.0)])
def test_a_camera_that_is_upside_down_or_upright_instead_of_level_never_counts_as_right(tilt_deg):
    """Roll alone does not tell: the images roll as they should."""
    for roll_rad in (np.pi, np.pi / 2, -np.pi / 2):
        mounted = Mount(roll_rad=roll_rad).T_body_camera()
        found = scores(0.0, np.array(tilt_deg), mounted=mounted)
        assert max(score for score in found if score is not None) < 5.0
        assert roll_rad < np.pi or found[-1] < -5.0


@pytest.mark.parametrize("mount", [ASSUMED, DOWN], ids=["ahead", "down"])
def test_a_vehicle_that_moves_as_it_tilts_is_not_taken_for_a_wrong_mounting(mount):
    """Tilt and translation go together; what the images make of both is told apart."""
    t = np.arange(60) * PERIOD_S
    roll, pitch = np.radians(2.0) * np.array([np.sin(2.0 * t), np.sin(1.5 * t + 1.0)])
    acceleration = 9.81 * np.stack([-pitch, roll, 0.02 * np.sin(2.0 * t)], axis=1)
    positions = np.cumsum(np.cumsum(acceleration, axis=0), axis=0) * PERIOD_S**2
    found = scores_of(np.stack([roll, pitch], axis=1), positions, mount.T_body_camera(), mount)
    assert min(score for score in found if score is not None) > -1.0
    assert found[-1] > 5.0


@pytest.mark.parametrize("tilt_deg", [0.0, 1e-4])
def test_attitudes_without_a_tilt_tell_nothing(tilt_deg):
    """As of a vehicle whose roll and pitch are not told, to the last bit or nearly so."""
    for mounted_deg in (0.0, 180.0):
        assert set(scores(mounted_deg, tilt_deg, seconds=2.0)) == {None}


def test_a_vehicle_that_tilts_by_the_noise_of_its_attitude_alone_decides_nothing():
    for mounted_deg in (0.0, 180.0):
        assert abs(score_of(mounted_deg, tilt_deg=0.0, noise_deg=0.01)) < 4.0


def test_motion_without_a_tilt_decides_nothing():
    found = scores(0.0, tilt_deg=0.0, velocity=(0.1, 0.1, 0.05), noise_deg=0.01)
    assert max(abs(s) for s in found if s is not None) < 4.0


def test_a_few_frames_say_nothing():
    assert score_of(180.0, tilt_deg=1.0, seconds=0.8) is None
    assert mounting_score(None) is None


@pytest.mark.parametrize("noise_deg", [0.3, 1.0, 3.0])
def test_noise_of_the_attitude_makes_it_less_sure_and_never_wrong(noise_deg):
    """It makes the slope too small: one that fits no mounting decides nothing."""
    sure, found = score_of(0.0, tilt_deg=1.0), scores(0.0, tilt_deg=1.0, noise_deg=noise_deg)
    assert min(score for score in found if score is not None) > -1.0
    assert found[-1] < sure


def test_a_score_is_bounded():
    known = MountingState(
        0, np.eye(3), np.zeros((2, 2)), 1e9 * np.eye(4), 1e9 * np.eye(2).ravel(), 2e9, 20.0
    )
    assert mounting_score(known) == MOST_SCORE


@pytest.mark.parametrize(("late_s", "frames"), [(2.0, 0.0), (0.5, 1.0), (0.0, 0.0)])
def test_a_gap_between_two_frames_is_passed_over(late_s, frames):
    first = begin_mounting(0, np.eye(3))
    late = begin_mounting(round(late_s * 1e9), rotation_from_euler(0.3, 0.0, 0.0))
    turn = turn_between(np.eye(4), SMALL)
    state = follow_mounting(first, late, turn, ASSUMED.T_body_camera()[:3, :3])
    assert state.frames == frames
    assert state.t_ns == late.t_ns
    np.testing.assert_array_equal(state.R_world_body, late.R_world_body)


def test_a_frame_whose_turn_is_not_known_is_passed_over():
    first, late = begin_mounting(0, np.eye(3)), begin_mounting(10**8, np.eye(3))
    assert follow_mounting(first, late, None, np.eye(3)).frames == 0.0


# --- probing --------------------------------------------------------------------------------

LAW = np.array([0.4, 0.1, 0.0, 0.2])


def probed(score, seconds=2.0):
    """Velocities ahead and to the right, every 100 ms."""
    return [tuple(probing_velocity(score, k * 10**8, LAW)[:2]) for k in range(round(10 * seconds))]


@pytest.mark.parametrize("score", [0.0, 4.9, -4.9])
def test_an_undecided_mounting_is_probed_about_both_axes_to_and_fro(score):
    ahead, back = [(0.3, 0.3)] * 5, [(-0.3, -0.3)] * 5
    assert probed(score) == [(0.4, 0.1)] * 5 + ahead + back + ahead


@pytest.mark.parametrize("score", [None, 5.0, -5.0])
def test_a_mounting_that_is_decided_or_cannot_be_told_is_not_probed(score):
    assert set(probed(score)) == {(0.4, 0.1)}


ESTIMATE = begin(PositionMeasurement(np.array([0.0, 0.0, 1.0]), 3.0, 0.0), SCALE_SPREAD)
UNDECIDED = MotionMeasures(0.0, 0.0, 0.0, False, 0.0, 0.0, False, False)


def flown(task, t_ns):
    """Velocity (4,) that is asked of an engaged vehicle 1 m before the goal."""
    flow, attitude = empty_flow((15, 20)), Attitude(0.0, 0.0, 0.0)
    inputs = ServoInputs(t_ns, t_ns, flow, np.zeros(4), attitude, engaged=True)
    return _probed(task, inputs, UNDECIDED, LAW, ESTIMATE)


@pytest.mark.parametrize(("limit_m_s", "axis_m_s"), [(0.1, 0.1 / np.sqrt(2.0)), (0.5, 0.3)])
def test_a_probe_turns_and_climbs_not_and_is_no_faster_than_the_settings_allow(limit_m_s, axis_m_s):
    config = ServoConfig(max_horizontal_m_s=limit_m_s)
    task = ServoTask(config, CAMERA, GoalSidecar(CAMERA), ASSUMED)
    for t_ns, side in ((5 * 10**8, 1.0), (10 * 10**8, -1.0)):
        np.testing.assert_allclose(
            flown(task, t_ns), [side * axis_m_s, side * axis_m_s, 0.0, 0.0], atol=1e-12
        )
