import numpy as np
import pytest

from dfvs_core.errors import GeometryError
from dfvs_core.geometry.camera import CameraModel

PINHOLE = CameraModel(320, 240, 208.5, 208.5, 160.0, 120.0)
LENS = CameraModel(320, 240, 200.0, 201.0, 158.0, 122.0, (0.1, -0.05, 0.001, 0.002, 0.01))


@pytest.mark.parametrize("camera", [PINHOLE, LENS])
def test_normalising_undoes_projection(camera, rng):
    points = np.column_stack([rng.uniform(-2, 2, (50, 2)), rng.uniform(3, 9, 50)])
    xy = camera.normalise(camera.project(points))
    # OpenCV's iteration stops at 1e-10 in normalised units.
    np.testing.assert_allclose(xy, points[:, :2] / points[:, 2:], atol=1e-8)


def test_the_axis_meets_the_middle_of_a_centred_image():
    camera = CameraModel.from_horizontal_fov(320, 240, np.radians(75))
    assert camera.project(np.array([0.0, 0.0, 2.0])) == pytest.approx([160.0, 120.0])
    edge = camera.normalise(np.array([320.0, 120.0]))
    assert np.degrees(np.arctan(edge[0])) == pytest.approx(37.5)


def test_grid_holds_pixel_centres():
    grid = PINHOLE.grid(stride=8)
    assert grid.shape == (30, 40, 2)
    assert grid[0, 0] == pytest.approx([4.5, 4.5])


def test_scaling_the_image_keeps_the_rays():
    half = LENS.scaled(160, 120)
    pixel = np.array([100.0, 60.0])
    np.testing.assert_allclose(half.normalise(pixel / 2), LENS.normalise(pixel), atol=1e-8)


@pytest.mark.parametrize(
    "values",
    [
        (8, 240, 200.0, 200.0, 4.0, 120.0),
        (320, 240, -1.0, 200.0, 160.0, 120.0),
        (320, 240, float("nan"), 200.0, 160.0, 120.0),
        (320, 240, 200.0, 200.0, 400.0, 120.0),
        (320, 240, 200.0, 200.0, 160.0, 120.0, (0.1,)),
    ],
)
def test_impossible_intrinsics_are_refused(values):
    with pytest.raises(GeometryError):
        CameraModel(*values)


@pytest.mark.parametrize("shape", [(5,), (1, 5), (5, 1)])
def test_intrinsics_as_opencv_returns_them_are_those_of_plain_numbers(shape):
    K = np.array([LENS.fx, LENS.fy, LENS.cx, LENS.cy], np.float32)
    distortion = np.array(LENS.distortion).reshape(shape)
    camera = CameraModel(np.int64(320), np.uint16(240), *K, distortion)
    assert camera == LENS
    assert {type(value) for value in (*camera.size, camera.fx, *camera.distortion)} == {int, float}
    assert hash(camera) == hash(LENS)


@pytest.mark.parametrize(
    "values",
    [
        (320.5, 240, 200.0, 200.0, 160.0, 120.0),
        ("320", 240, 200.0, 200.0, 160.0, 120.0),
        (320, 240, None, 200.0, 160.0, 120.0),
        (320, 240, 200.0, 200.0, np.zeros(2), 120.0),
        (320, 240, 200.0, 200.0, 160.0, 120.0, np.zeros((2, 4))),
        (320, 240, 200.0, 200.0, 160.0, 120.0, "none"),
        (320, 240, 200.0, 200.0, 160.0, 120.0, None),
    ],
)
def test_intrinsics_that_are_no_numbers_are_refused(values):
    with pytest.raises(GeometryError):
        CameraModel(*values)


@pytest.mark.parametrize("degrees", [0, 180, 200, -5])
def test_impossible_fields_of_view_are_refused(degrees):
    with pytest.raises(GeometryError, match="field of view"):
        CameraModel.from_horizontal_fov(320, 240, np.radians(degrees))
