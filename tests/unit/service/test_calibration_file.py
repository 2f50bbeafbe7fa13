import pytest

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.camera import CameraModel
from dfvs_service.settings.calibration_file import (
    read_calibration,
    with_calibration,
    write_calibration,
)
from dfvs_service.settings.config import load_config

CAMERA = CameraModel(640, 480, 512.25, 511.5, 320.125, 239.875, (0.1, -0.2, 1e-3, -2e-3, 0.05))


@pytest.fixture
def path(tmp_path):
    made = tmp_path / "camera.toml"
    write_calibration(made, CAMERA, ["root mean square error 0.1 px"])
    return made


def test_a_calibration_is_read_as_it_was_written(path):
    assert read_calibration(path) == CAMERA
    assert "# root mean square error 0.1 px" in path.read_text()


def test_it_serves_as_the_service_s_settings_and_by_name(path):
    assert load_config(path, {}).camera.model() == CAMERA
    named = load_config(None, {"camera.calibration_file": str(path)})
    assert with_calibration(named).camera.model() == CAMERA
    assert with_calibration(load_config(None, {})) == load_config(None, {})


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({"camera.horizontal_fov_deg": 70, "camera.width": 640, "camera.height": 480}, "both"),
        ({"camera.width": 320}, "camera.width is 320; expected 640"),
    ],
)
def test_settings_that_contradict_it_are_refused(path, overrides, words):
    config = load_config(None, {"camera.calibration_file": str(path), **overrides})
    with pytest.raises(ConfigError, match=words):
        with_calibration(config)


def test_a_file_without_intrinsics_is_refused(tmp_path):
    (tmp_path / "x.toml").write_text("[camera]\nwidth = 640\n")
    with pytest.raises(ConfigError, match="holds no calibration"):
        read_calibration(tmp_path / "x.toml")


@pytest.mark.parametrize("text", ["image_width: 640\n", '<?xml version="1.0"?>\n'])
def test_a_calibration_of_another_program_is_refused_with_what_is_expected(tmp_path, text):
    path = tmp_path / "camera.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        read_calibration(path)
    assert "camera.yaml is not TOML" in caught.value.problem
    assert "[camera] with width, height, fx, fy, cx, cy" in caught.value.expected
    assert "dfvs-camera calibrate" in caught.value.remedy


def test_a_folder_that_is_not_there_leaves_nothing(tmp_path):
    with pytest.raises(ConfigError, match="cannot be written"):
        write_calibration(tmp_path / "no" / "camera.toml", CAMERA, [])
    assert list(tmp_path.iterdir()) == []
