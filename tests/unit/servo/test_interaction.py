import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dfvs_core.geometry.interaction import interaction_matrix
from dfvs_core.geometry.poses import invert_pose, se3_exp
from dfvs_core.messages.goal import Mount
from dfvs_core.servo.freedom import level_body

coordinate = st.floats(-1.0, 1.0)
STEP = 1e-6


def moved(xy, z, twist):
    """Where a point is seen after the camera moved by the twist."""
    P = np.array([xy[0] * z, xy[1] * z, z, 1.0])
    Q = invert_pose(se3_exp(twist)) @ P
    return Q[:2] / Q[2]


@given(st.tuples(coordinate, coordinate), st.floats(0.3, 20.0))
def test_interaction_matrix_is_the_derivative_of_the_projection(xy, z):
    L = interaction_matrix(np.array([xy]), np.array([z]))[0]
    for axis in range(6):
        twist = np.zeros(6)
        twist[axis] = STEP
        slope = (moved(xy, z, twist) - moved(xy, z, -twist)) / (2 * STEP)
        # Central differences: error of order STEP^2 / z^3 plus rounding of 1e-16 / STEP.
        np.testing.assert_allclose(L[:, axis], slope, atol=1e-6)


def test_interaction_matrix_has_the_paper_s_rows():
    x, y, z = 0.3, -0.2, 2.0
    L = interaction_matrix(np.array([[x, y]]), np.array([z]))[0]
    expected = [
        [-1 / z, 0, x / z, x * y, -(1 + x * x), y],
        [0, -1 / z, y / z, 1 + y * y, -x * y, -x],
    ]
    np.testing.assert_allclose(L, expected)


def test_body_motions_move_the_image_as_they_should():
    B = level_body(Mount().T_body_camera()).B
    centre = interaction_matrix(np.array([[0.0, 0.0]]), np.array([2.0]))[0] @ B
    forward, right, down, yaw = centre.T
    np.testing.assert_allclose(forward, [0, 0], atol=1e-12)  # the focus of expansion
    assert right[0] < 0  # going right, the world goes left
    assert down[1] < 0  # going down, the world goes up
    np.testing.assert_allclose([right[1], down[0]], 0, atol=1e-12)
    assert yaw[0] < 0  # turning right, the world goes left


def test_a_lens_ahead_of_the_yaw_axis_swings_sideways_when_yawing():
    twist = level_body(Mount(x_m=0.2).T_body_camera()).B @ [0, 0, 0, 1.0]
    # Camera x is body right: a turn to the right carries a lens in front to the right.
    np.testing.assert_allclose(twist, [0.2, 0, 0, 0, 1.0, 0], atol=1e-12)
