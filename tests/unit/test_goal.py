import json

import numpy as np
import pytest

from dfvs_core.errors import ConfigError, DfvsError
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import GoalSidecar, Mount

CAMERA = CameraModel(320, 240, 208.5, 208.5, 160.0, 120.0, (0.1, 0.0, 0.0, 0.0))


def test_a_sidecar_survives_its_file():
    sidecar = GoalSidecar(CAMERA, 0.1, -0.2, Mount(x_m=0.1, pitch_rad=-0.3), tuple(range(16)))
    again = GoalSidecar.from_json(sidecar.to_json())
    assert again == GoalSidecar(
        CAMERA, 0.1, -0.2, Mount(x_m=0.1, pitch_rad=-0.3), tuple(float(i) for i in range(16))
    )


def test_a_level_mount_looks_ahead():
    T = Mount(x_m=0.1, z_m=-0.05).T_body_camera()
    np.testing.assert_allclose(T[:3, 2], [1, 0, 0], atol=1e-12)  # optical axis: body forward
    np.testing.assert_allclose(T[:3, 0], [0, 1, 0], atol=1e-12)  # image right: body right
    np.testing.assert_allclose(T[:3, 3], [0.1, 0, -0.05])


def test_positive_pitch_looks_up():
    axis = Mount(pitch_rad=0.4).T_body_camera()[:3, 2]
    assert axis[2] == pytest.approx(-np.sin(0.4))


@pytest.mark.parametrize(
    "change",
    [
        {"format": "dfvs-goal/9"},
        {"camera": {"width": 320}},
        {"pose_camera": [1.0, 2.0]},
        {"roll_rad": "steep"},
        {"rolll_rad": 0.1},
    ],
)
def test_a_wrong_sidecar_is_refused(change):
    document = json.loads(GoalSidecar(CAMERA).to_json()) | change
    with pytest.raises(DfvsError):
        GoalSidecar.from_json(json.dumps(document))


def test_what_is_not_json_is_refused():
    with pytest.raises(DfvsError, match="not JSON"):
        GoalSidecar.from_json("{")


@pytest.mark.parametrize("angle", ["roll_rad", "pitch_rad", "yaw_rad"])
@pytest.mark.parametrize("value", [-20.0, 6.4, np.inf, np.nan])
def test_a_mounting_in_degrees_is_refused(angle, value):
    with pytest.raises(ConfigError, match=r"rad.*in rad"):
        Mount(**{angle: value})


def test_a_sidecar_with_a_mounting_in_degrees_is_refused():
    text = GoalSidecar(CAMERA, mount=Mount(pitch_rad=-0.25)).to_json()
    with pytest.raises(ConfigError, match="in rad"):
        GoalSidecar.from_json(text.replace("-0.25", "-20.0"))


def test_a_mounting_may_be_a_whole_turn():
    assert Mount(yaw_rad=-2.0 * np.pi).T_body_camera() == pytest.approx(Mount().T_body_camera())


@pytest.mark.parametrize("angle", ["roll_rad", "pitch_rad"])
@pytest.mark.parametrize("value", [-2.5, 12.0, np.nan])
def test_a_sidecar_whose_roll_or_pitch_is_in_degrees_is_refused(angle, value):
    with pytest.raises(ConfigError, match=rf"{angle[:-4]} of a goal is .*90 degrees.*in rad"):
        GoalSidecar(CAMERA, **{angle: value})
