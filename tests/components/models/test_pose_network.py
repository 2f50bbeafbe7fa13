"""``pose`` bundles: what they give, and those that are refused."""

import numpy as np
import pytest
from onnx_network import write_bundle
from pose_bundle import bundle

from dfvs_core.errors import ModelError
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import se3_log, so3_log
from dfvs_models.catalog import load_matcher, load_pose
from dfvs_models.onnx_session import Execution
from dfvs_models.pose import PoseNetwork

CAMERA = CameraModel.from_horizontal_fov(64, 48, 1.2)
FOCAL = CAMERA.fx / CAMERA.width


def pose(made, first=100, second=100):
    network = PoseNetwork(made, Execution(1))
    views = (np.full((48, 64, 3), level, np.uint8) for level in (first, second))
    return network.relative_pose(*(network.fit(view, CAMERA) for view in views))


def test_the_pose_is_that_of_the_second_camera_in_the_first():
    T = pose(bundle((0.1, -0.2, 0.3), (0.0, 0.2, 0.1 - FOCAL)), first=255, second=204)
    np.testing.assert_allclose(T[:3, 3], (0.1 + 0.2, -0.2, 0.3), atol=1e-5)
    np.testing.assert_allclose(so3_log(T[:3, :3]), (0.0, 0.2, 0.1), atol=1e-5)


def test_a_quaternion_may_have_any_length():
    T = pose(bundle((0.0, 0.0, 0.0), (3.0, 0.0, 3.0, -FOCAL)))
    np.testing.assert_allclose(se3_log(T), (0, 0, 0, 0, np.pi / 2, 0), atol=1e-5)


def test_a_quaternion_of_zeros_is_no_rotation():
    with pytest.raises(ModelError, match="is a quaternion of zeros"):
        pose(bundle((0, 0, 0), (0, 0, 0, -FOCAL)))


STILL = bundle((0, 0, 0), (0, 0, 0))


def outputs(*names):
    graph = {"file": "pose.onnx", "inputs": ["first", "second", "focal"], "outputs": names}
    return {"graphs": {"pose": graph}}


@pytest.mark.parametrize(
    ("made", "changes", "words"),
    [
        (STILL, {"input": {"width": 64, "channels": "grey"}}, "input 'firs"),
        (STILL, {"pose": {"unit": "m", "rotation": "quaternion"}}, "float32 of"),
        (bundle((np.inf, 0, 0), (0, 0, 0)), {}, "not finite"),
        (STILL, outputs("translation", "turn"), "lacks the outputs"),
        (STILL, outputs("translation"), "3 inputs and 1 outputs"),
        (STILL, {"pose": None}, "lacks 'pose'"),
    ],
)
def test_a_bundle_that_is_not_as_its_manifest_says_is_refused(tmp_path, made, changes, words):
    folder = write_bundle(tmp_path / "bundle", made, **changes)
    with pytest.raises(ModelError, match=words):
        load_pose(str(folder))


def test_kinds_are_not_taken_for_each_other(tmp_path):
    folder = write_bundle(tmp_path / "bundle", STILL)
    with pytest.raises(ModelError, match="kind 'pose', which gives a pose"):
        load_matcher(str(folder))
    with pytest.raises(ModelError, match="which gives no pose"):
        load_pose("dfvs-flow")
