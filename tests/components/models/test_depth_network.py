"""Depth of images by a ``mono`` bundle in ONNX Runtime."""

import numpy as np
import pytest
from depth_bundle import bundle
from onnx_network import write_bundle

from dfvs_core.errors import ImageError, ModelError
from dfvs_core.geometry.camera import CameraModel
from dfvs_models.catalog import depth_files, load_depth
from dfvs_models.depth import DepthNetwork, fit_image
from dfvs_models.onnx_session import Execution

ROWS, COLUMNS = 24, 32
CAMERA = CameraModel.from_horizontal_fov(64, 48, 1.2)
RAMP = np.tile(np.linspace(0.2, 0.5, COLUMNS), (ROWS, 1))


def grey(camera, value=100):
    return np.full((camera.height, camera.width, 3), value, np.uint8)


def estimate(made, camera=CAMERA, image=None):
    image = grey(camera) if image is None else image
    return DepthNetwork(made, Execution(1)).estimate(image, camera)


@pytest.mark.parametrize("size", [(64, 48), (320, 240), (100, 48), (33, 70)])
def test_depth_comes_in_the_size_of_the_image_and_at_its_place(size):
    camera = CameraModel.from_horizontal_fov(*size, 1.2)
    found = estimate(bundle(RAMP), camera)
    assert found.rho.shape == found.spread.shape == size[::-1]
    fitted = fit_image(grey(camera), camera, bundle(RAMP).manifest.input)
    x = fitted.corner_px[0] + (np.arange(size[0]) + 0.5) * fitted.size_px[0] / size[0]
    wanted = np.interp(x / 2 - 0.5, np.arange(COLUMNS), RAMP[0])
    np.testing.assert_allclose(found.rho, np.tile(wanted, (size[1], 1)), atol=3e-3)


def test_an_image_is_fitted_with_square_pixels():
    spec = bundle(RAMP).manifest.input
    narrow = CameraModel(64, 48, 40.0, 80.0, 32.0, 24.0)  # a square looks twice as high as wide
    fitted = fit_image(grey(narrow), narrow, spec)
    assert fitted.size_px == (64, 24)
    assert fitted.corner_px == (0, 12)
    assert fitted.focal == pytest.approx(40.0 / 64.0)


def test_borders_that_the_image_does_not_fill_do_not_change_its_brightness():
    wide = CameraModel.from_horizontal_fov(128, 48, 1.2)
    found = estimate(bundle(RAMP, by_image=1.0), wide, grey(wide, 51))
    np.testing.assert_allclose(
        found.rho[:, 64], estimate(bundle(RAMP), wide).rho[:, 64] + 0.2, rtol=1e-4
    )


def test_the_network_is_told_the_focal_length_over_the_width_of_its_own_image():
    large = CameraModel.from_horizontal_fov(640, 480, 1.2)
    found, without = (estimate(bundle(RAMP, by_focal=b), large) for b in (1.0, 0.0))
    np.testing.assert_allclose(found.rho - without.rho, large.fx / 640.0, rtol=1e-5)


def test_depth_in_metres_becomes_inverse_depth():
    made = bundle(2.0 + RAMP, unit="m")
    found = estimate(made)
    assert found.unit == "m"
    np.testing.assert_allclose(
        1.0 / found.rho[10, 1:-1:2], 2.0 + estimate(bundle(RAMP)).rho[10, 1:-1:2], rtol=1e-5
    )


def test_the_spread_is_the_graphs_or_the_manifests():
    of_graph = estimate(bundle(RAMP, spread=np.full((ROWS, COLUMNS), 0.3)))
    np.testing.assert_allclose(of_graph.spread, 0.3, rtol=1e-6)
    np.testing.assert_allclose(estimate(bundle(RAMP)).spread, 0.2, rtol=1e-6)


def test_an_image_of_another_size_than_its_camera_is_refused():
    with pytest.raises(ImageError, match="the image has 10 x 10 px"):
        estimate(bundle(RAMP), image=np.zeros((10, 10, 3), np.uint8))


def test_the_same_image_gives_the_same_bits():
    network = DepthNetwork(bundle(RAMP, by_image=0.3, by_focal=0.2), Execution(2))
    image = np.random.default_rng(0).integers(0, 255, (48, 64, 3), dtype=np.uint8)
    first, second = (network.estimate(image, CAMERA) for _ in range(2))
    assert first.rho.tobytes() == second.rho.tobytes()


def quantity(name, **more):
    return {"depth": {"quantity": name, "unit": "1/m", "spread": 0.2, "scale_spread": 0.1, **more}}


def graph(inputs, output):
    return {"graphs": {"mono": {"file": "mono.onnx", "inputs": inputs, "outputs": [output]}}}


@pytest.mark.parametrize(
    ("made", "changes", "words"),
    [
        (bundle(RAMP), {"input": {"width": 128, "height": 48}}, "input 'image'"),
        (bundle(RAMP[:, ::2]), quantity("inverse-depth", stride=4), "is float32 of"),
        (bundle(np.full_like(RAMP, np.inf)), {}, "not finite"),
        (bundle(RAMP), quantity("depth"), "depth in the unit '1/m'"),
        (bundle(RAMP), graph(["focal", "image"], "inverse_depth"), "has the inputs"),
        (bundle(RAMP), graph(["image", "focal"], "depth"), "lacks the outputs"),
    ],
)
def test_a_bundle_that_is_not_as_its_manifest_says_is_refused(tmp_path, made, changes, words):
    folder = write_bundle(tmp_path / "bundle", made, **changes)
    with pytest.raises(ModelError, match=words):
        load_depth("network", str(folder))


def test_a_depth_with_an_unknown_offset_flies_fused_only(tmp_path):
    folder = str(write_bundle(tmp_path / "bundle", bundle(RAMP, unit="affine")))
    assert load_depth("fused", folder) is not None
    with pytest.raises(ModelError, match="unknown offset"):
        load_depth("network", folder)


def test_no_bundle_is_looked_for_where_none_is_needed():
    assert load_depth("motion", "there is none") is None
    assert depth_files("motion", "there is none") == {}


def test_the_files_of_a_depth_network_are_named_apart(tmp_path):
    folder = write_bundle(tmp_path / "bundle", bundle(RAMP))
    assert sorted(depth_files("fused", str(folder))) == ["depth/manifest.json", "depth/mono.onnx"]
