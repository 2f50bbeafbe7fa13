"""Group laws on random rigid motions."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dfvs_core.errors import GeometryError
from dfvs_core.geometry.poses import (
    check_pose,
    euler_from_rotation,
    invert_pose,
    pose_error,
    quaternion_from_rotation,
    rotation_from_euler,
    rotation_from_quaternion,
    se3_exp,
    se3_log,
    so3_exp,
    so3_log,
    wrap_angle,
)

# Rotation vectors stay below pi, where the logarithm is unique.
unit = st.floats(-1.0, 1.0, allow_subnormal=False)
rotation_vectors = st.tuples(unit, unit, unit).map(lambda v: np.array(v) * 1.8)
twists = st.tuples(*[unit] * 6).map(lambda v: np.array(v) * [9, 9, 9, 1.8, 1.8, 1.8])
angles = st.floats(-1.5, 1.5)

EXACT = 1e-9


@given(twists)
def test_log_undoes_exp(twist):
    np.testing.assert_allclose(se3_log(se3_exp(twist)), twist, atol=1e-7)


@given(rotation_vectors)
def test_exp_of_a_rotation_vector_is_a_rotation(w):
    R = so3_exp(w)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=EXACT)
    assert np.linalg.det(R) == pytest.approx(1.0)
    np.testing.assert_allclose(so3_log(R), w, atol=1e-7)


@given(twists, twists, twists)
def test_motions_compose_associatively(a, b, c):
    A, B, C = se3_exp(a), se3_exp(b), se3_exp(c)
    np.testing.assert_allclose((A @ B) @ C, A @ (B @ C), atol=1e-9)


@given(twists)
def test_a_motion_and_its_inverse_cancel(twist):
    T = se3_exp(twist)
    np.testing.assert_allclose(T @ invert_pose(T), np.eye(4), atol=EXACT)
    np.testing.assert_allclose(se3_exp(-twist), invert_pose(T), atol=1e-8)


@given(angles, angles, st.floats(-3.1, 3.1))
def test_euler_angles_survive_the_round_trip(roll, pitch, yaw):
    again = euler_from_rotation(rotation_from_euler(roll, pitch, yaw))
    np.testing.assert_allclose(again, (roll, pitch, yaw), atol=1e-7)


@pytest.mark.parametrize("quarters", list(itertools.product(range(4), repeat=3)))
def test_a_rotation_along_the_axes_survives_too_though_the_nose_points_straight_up(quarters):
    R = np.rint(rotation_from_euler(*(0.5 * np.pi * np.array(quarters))))
    np.testing.assert_allclose(rotation_from_euler(*euler_from_rotation(R)), R, atol=1e-12)


@given(rotation_vectors)
def test_quaternions_survive_the_round_trip(w):
    R = so3_exp(w)
    q = quaternion_from_rotation(R)
    assert q[0] >= 0
    np.testing.assert_allclose(rotation_from_quaternion(q), R, atol=EXACT)


@given(twists, twists)
def test_pose_error_is_symmetric_and_zero_only_at_home(a, b):
    A, B = se3_exp(a), se3_exp(b)
    assert pose_error(A, A) == pytest.approx((0.0, 0.0), abs=1e-7)
    np.testing.assert_allclose(pose_error(A, B), pose_error(B, A), atol=1e-7)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-8, 1e-6, 1e-4, 3.14159, np.pi])
def test_logarithm_holds_at_the_ends_of_its_range(angle):
    w = np.array([0.6, 0.0, 0.8]) * angle
    assert np.linalg.norm(so3_log(so3_exp(w))) == pytest.approx(angle, abs=1e-7)


def test_pitch_up_lifts_the_nose():
    # FRD: forward is x; in NED, up is negative z.
    nose = rotation_from_euler(0.0, 0.3, 0.0) @ [1, 0, 0]
    assert nose[2] == pytest.approx(-np.sin(0.3))


@given(st.floats(-50.0, 50.0))
def test_wrapped_angles_lie_in_half_open_range_and_mean_the_same(angle):
    wrapped = wrap_angle(angle)
    assert -np.pi <= wrapped < np.pi
    assert np.cos(wrapped - angle) == pytest.approx(1.0)


@pytest.mark.parametrize(
    "T", [np.eye(3), np.full((4, 4), np.nan), np.diag([1.0, 1.0, -1.0, 1.0]), 2 * np.eye(4)]
)
def test_what_is_no_rigid_motion_is_refused(T):
    with pytest.raises(GeometryError):
        check_pose(T)
