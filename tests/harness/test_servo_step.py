"""servo_step closed over exact flow in a box-shaped room: no network, no renderer, no vehicle."""

from dataclasses import replace

import numpy as np
import pytest
from box_room import BoxRoom

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import make_pose, pose_error, rotation_from_euler, se3_exp
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.exchange import Attitude, EarlierMatch, ServoInputs, ServoState, Status
from dfvs_core.servo.step import servo_step
from dfvs_core.servo.structure.relative_depth import observe_depth
from dfvs_core.servo.task import ServoTask

CAMERA = CameraModel.from_horizontal_fov(160, 120, np.radians(75))
ROOM = BoxRoom(CAMERA)
FRAME_NS = 50_000_000
EXACT = ServoConfig(depth="given", response_s=0.0, yaw_response_s=0.0)
TASK = ServoTask(EXACT, CAMERA, GoalSidecar(CAMERA), Mount())


def body_pose(x, y, z, yaw_deg, roll_deg=0.0, pitch_deg=0.0):
    R = rotation_from_euler(*np.radians([roll_deg, pitch_deg, yaw_deg]))
    return make_pose(R, np.array([x, y, z]))


HERE = body_pose(0, 0, 0, 0) @ Mount().T_body_camera()
FLOW = ROOM.flow(HERE, body_pose(0.4, 0.1, 0, 5) @ Mount().T_body_camera())
"""Of a vehicle at the origin to a goal near by."""


def inputs(k, flow, velocity, **more):
    t = k * FRAME_NS
    return ServoInputs(now_ns=t, t_capture_ns=t, flow=flow, velocity=velocity, **more)


def set_to(**changes):
    """The task with other settings."""
    return replace(TASK, config=replace(EXACT, **changes))


def fly(task, T_world_body, T_world_goal_camera, seconds=40.0, told=None):
    """A level vehicle that follows at once, with motion depth from its own displacement.

    ``told`` is the attitude that it believes in.
    """
    T_body_camera = task.mount.T_body_camera()
    state, velocity, earlier_poses, result = ServoState(), np.zeros(4), [], None
    for k in range(int(seconds * 1e9 / FRAME_NS)):
        T_cam = T_world_body @ T_body_camera
        earlier = None
        if len(earlier_poses) > 5:
            T_then = earlier_poses[-6]
            motion = np.linalg.inv(T_then) @ T_cam
            earlier = EarlierMatch(ROOM.flow(T_cam, T_then), motion)
        moved = (0.0, 0.0, 0.0)
        if earlier_poses:
            last = earlier_poses[-1]
            moved = tuple(last[:3, :3].T @ (T_cam[:3, 3] - last[:3, 3]))
        step = inputs(
            k,
            ROOM.flow(T_cam, T_world_goal_camera),
            velocity,
            earlier=earlier,
            motion_m=moved,
            attitude=told or Attitude(),
            given_depth=ROOM.depth_map(T_cam),
        )
        result, state = servo_step(task, state, step)
        if earlier is not None and k % 4 == 0:
            state = observe_depth(task, state, earlier)
        if result.reached:
            break
        earlier_poses.append(T_cam)
        velocity = result.velocity
        twist = np.array([*velocity[:3], 0.0, 0.0, velocity[3]])
        T_world_body = T_world_body @ se3_exp(twist * FRAME_NS * 1e-9)
    return result, T_world_body @ T_body_camera


@pytest.mark.parametrize("depth", ["given", "motion", "constant"])
def test_a_level_vehicle_reaches_the_goal(depth):
    mount = Mount(x_m=0.1, z_m=0.03)
    config = replace(EXACT, depth=depth)
    task = ServoTask(config, CAMERA, GoalSidecar(CAMERA), mount)
    T_goal = body_pose(0.0, 0.0, 0.2, 10.0) @ mount.T_body_camera()
    result, T_final = fly(task, body_pose(-1.0, 0.8, -0.1, -15.0), T_goal)
    assert result.reached
    translation_m, rotation_rad = pose_error(T_final, T_goal)
    # With a constant depth the distance is only known up to that depth's error.
    assert translation_m < (0.06 if depth == "constant" else config.tolerance_m * 1.2)
    assert rotation_rad < config.tolerance_rad * 1.2


def test_motion_depth_is_metric():
    T_goal = body_pose(0.5, 0.0, 0.0, 0.0) @ TASK.mount.T_body_camera()
    result, T_final = fly(set_to(depth="motion"), body_pose(-1.0, 0.5, 0.0, 15.0), T_goal)
    true_depth = np.median(ROOM.depth(T_final))
    assert result.depth_m == pytest.approx(true_depth, rel=0.1)


@pytest.mark.parametrize(("roll_deg", "pitch_deg"), [(0, 12), (-10, 0), (8, -15)])
def test_the_tilt_of_the_body_does_not_change_the_motion(roll_deg, pitch_deg):
    T_goal = body_pose(0.6, 0.2, 0.1, 12.0) @ TASK.mount.T_body_camera()
    motions = []
    for roll, pitch in ((0, 0), (roll_deg, pitch_deg)):
        T_cam = body_pose(0, 0, 0, 0, roll, pitch) @ TASK.mount.T_body_camera()
        step = inputs(
            0,
            ROOM.flow(T_cam, T_goal),
            np.zeros(4),
            attitude=Attitude(*np.radians([roll, pitch])),
            given_depth=ROOM.depth_map(T_cam),
        )
        result, _ = servo_step(TASK, ServoState(), step)
        motions.append(result.motion)
    np.testing.assert_allclose(motions[1], motions[0], atol=2e-3)
    np.testing.assert_allclose(motions[0], [0.6, 0.2, 0.1, np.radians(12)], atol=0.08)


def test_the_tilt_of_the_goal_is_taken_out():
    """A goal taken while the vehicle leant is still reached by a level vehicle."""
    sidecar = GoalSidecar(CAMERA, roll_rad=np.radians(6), pitch_rad=np.radians(-9))
    task = replace(TASK, goal=sidecar)
    T_goal = body_pose(0.3, 0.1, 0.0, 5.0, 6.0, -9.0) @ task.mount.T_body_camera()
    result, T_final = fly(task, body_pose(-0.5, -0.3, 0.1, -10.0), T_goal)
    assert result.reached
    assert np.linalg.norm(T_final[:3, 3] - T_goal[:3, 3]) < 0.03


@pytest.mark.parametrize(("roll_deg", "pitch_deg"), [(1.5, -1.0), (-0.5, 2.0)])
def test_a_level_vehicle_that_believes_to_lean_reaches_the_goal(roll_deg, pitch_deg):
    T_goal = body_pose(0.3, 0.1, 0.0, 5.0) @ TASK.mount.T_body_camera()
    told = Attitude(*np.radians([roll_deg, pitch_deg]))
    result, T_final = fly(TASK, body_pose(-0.5, -0.3, 0.1, -10.0), T_goal, told=told)
    assert result.reached
    assert np.linalg.norm(T_final[:3, 3] - T_goal[:3, 3]) < 0.03


def test_a_free_camera_uses_all_six_degrees():
    task = ServoTask(replace(EXACT, max_turn_rad_s=2.0), CAMERA, GoalSidecar(CAMERA))
    T_goal = body_pose(0.4, -0.2, 0.1, 8.0, 10.0, -7.0) @ Mount().T_body_camera()
    T_cam, state = HERE, ServoState()
    for k in range(400):
        step = inputs(k, ROOM.flow(T_cam, T_goal), np.zeros(6), given_depth=ROOM.depth_map(T_cam))
        result, state = servo_step(task, state, step)
        T_cam = T_cam @ se3_exp(result.velocity * FRAME_NS * 1e-9)
    translation_m, rotation_rad = pose_error(T_cam, T_goal)
    assert translation_m < 0.01
    assert rotation_rad < np.radians(0.3)


def seen_here(flow, task=TASK, state=None, k=0, velocity=(0.0, 0.0, 0.0, 0.0), **more):
    """Result and state of the k-th frame of a vehicle at the origin."""
    step = inputs(k, flow, np.array(velocity), given_depth=ROOM.depth_map(HERE), **more)
    return servo_step(task, state or ServoState(), step)


def test_a_given_depth_that_is_not_there_is_an_error():
    with pytest.raises(ConfigError, match="got no depth; expected a depth map with every frame"):
        servo_step(TASK, ServoState(), inputs(0, FLOW, np.zeros(4)))


def one_frame(flow, task=TASK, state=None, **more):
    return seen_here(flow, task, state, **more)[0]


def test_flow_that_is_not_finite_stops():
    broken = FLOW.flow.copy()
    broken[3, 4, 0] = np.nan
    result = one_frame(FlowField(broken, FLOW.confidence))
    assert result.status is Status.NOT_FINITE
    assert not result.velocity.any()


def test_too_little_overlap_stops():
    result = one_frame(FlowField(FLOW.flow, FLOW.confidence * 0.01))
    assert result.status is Status.NO_OVERLAP
    assert not result.velocity.any()


def test_a_goal_that_was_found_may_shrink_to_half_the_share_that_finding_it_takes():
    task = set_to(min_overlap=0.3)

    def seen(share, state):
        strip = np.zeros_like(FLOW.confidence)
        strip[: round(share * strip.shape[0])] = 1.0
        return one_frame(FlowField(FLOW.flow, FLOW.confidence * strip), task, state)

    assert seen(0.6, ServoState()).status is Status.OK
    _, found = seen_here(FLOW, task)
    assert seen(0.3, ServoState()).status is Status.NO_OVERLAP
    assert seen(0.3, found).status is Status.OK
    assert seen(0.1, found).status is Status.NO_OVERLAP


def test_confident_nonsense_stops(rng):
    flow = rng.uniform(-60, 60, (120, 160, 2)).astype(np.float32)
    result = one_frame(FlowField(flow, np.ones((120, 160), np.float32)))
    assert result.status is not Status.OK
    assert not result.velocity.any()


def test_a_third_of_wrong_correspondences_changes_little(rng):
    wrong = FLOW.flow.copy()
    wrong[:, 50:100] += rng.normal(0, 25, (120, 50, 2)).astype(np.float32)
    clean, dirty = one_frame(FLOW), one_frame(FlowField(wrong, FLOW.confidence))
    assert dirty.status is Status.OK
    np.testing.assert_allclose(dirty.motion, clean.motion, atol=0.03)


def test_correspondences_that_no_rigid_scene_explains_are_flown_on_slowly(rng):
    """Full gain to five times the flow's noise, a quarter from nearly ten times on."""
    noise = rng.normal(0.0, 1.0, FLOW.flow.shape).astype(np.float32)
    task = set_to(flow_noise_px=0.3, max_horizontal_m_s=10.0, max_vertical_m_s=10.0)
    found = []
    for scale in (0.3, 1.5, 2.2):
        result = one_frame(FlowField(FLOW.flow + scale * noise, FLOW.confidence), task)
        assert result.status is Status.OK
        found.append((result.residual_px, np.linalg.norm(result.velocity[:3])))
    (calm, full), (some, slower), (much, slowest) = found
    assert calm < 1.5 < some < much < 3.0
    assert slower == pytest.approx(full * (2.0 - some / 1.5), rel=0.1)
    assert slowest == pytest.approx(full * max(2.0 - much / 1.5, 0.25), rel=0.1)


def test_where_little_of_the_goal_is_seen_the_vehicle_flies_slowly():
    """Full gain from 15 % of the view on, less in proportion below."""
    task = set_to(stride_px=4, min_overlap=0.02, max_horizontal_m_s=10.0, max_vertical_m_s=10.0)
    found = []
    for rows in (48, 24, 20, 12):
        confidence = FLOW.confidence.copy()
        confidence[: 60 - rows // 2] = confidence[60 + rows // 2 :] = 0.0
        result = one_frame(FlowField(FLOW.flow, confidence), task)
        assert result.status is Status.OK
        found.append((result.overlap, np.linalg.norm(result.velocity[:3])))
    (wide, full), *narrow = found
    assert wide > 0.3
    for overlap, speed in narrow:
        assert speed == pytest.approx(full * min(overlap / 0.15, 1.0), rel=0.02)
    assert narrow[0][0] > 0.15 > narrow[1][0] > narrow[2][0]


def test_points_in_one_spot_are_degenerate():
    confidence = np.zeros_like(FLOW.confidence)
    confidence[56:64, 76:84] = 1.0
    task = set_to(min_overlap=0.0, stride_px=2, max_condition=1e3)
    # All points on the axis, so near to each other that turning looks like moving sideways.
    result = one_frame(FlowField(FLOW.flow, confidence), task)
    assert result.status in (Status.DEGENERATE, Status.NO_OVERLAP)
    assert not result.velocity.any()


def standing(engaged):
    """Results of six seconds in which nothing moves."""
    state, results = ServoState(), []
    for k in range(120):
        result, state = seen_here(FLOW, state=state, k=k, engaged=engaged)
        results.append(result)
    return results


def test_an_error_that_does_not_fall_is_called_stuck():
    statuses = [result.status for result in standing(engaged=True)]
    seconds = statuses.index(Status.STUCK) * FRAME_NS * 1e-9
    assert seconds == pytest.approx(EXACT.progress_s, abs=0.2)


def test_waiting_for_the_pilot_is_not_being_stuck():
    results = standing(engaged=False)
    assert {(result.status, result.reached) for result in results} == {(Status.OK, False)}


def test_velocity_keeps_its_direction_when_it_saturates():
    slow = one_frame(FLOW, set_to(max_horizontal_m_s=0.05, gain_far=2.0, gain_near=2.0))
    fast = one_frame(FLOW)
    assert np.linalg.norm(slow.velocity[:2]) == pytest.approx(0.05)
    np.testing.assert_allclose(
        slow.velocity / np.linalg.norm(slow.velocity),
        fast.velocity / np.linalg.norm(fast.velocity),
        atol=1e-6,
    )


def test_the_vehicle_s_late_answer_is_predicted():
    """A vehicle already on its way is asked for less."""
    task = set_to(response_s=0.6, gain_far=1.0, gain_near=1.0)  # far from the limit
    at_rest, moving = (one_frame(FLOW, task, velocity=(v, 0, 0, 0)).velocity for v in (0.0, 0.3))
    assert moving[0] < at_rest[0] - 0.05
