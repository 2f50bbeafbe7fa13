"""Calibration images in which the board is never tilted."""

import dataclasses

import cv2
import numpy as np
import pytest

from dfvs_core.errors import ConfigError
from dfvs_service.camera.calibration.boards import BoardView
from dfvs_service.camera.calibration.intrinsics import calibrate

K = np.array([[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize("lens", ["plumb_bob", "rational"])
def test_boards_that_are_never_tilted_fix_no_camera(lens):
    x, y = np.meshgrid(np.arange(6), np.arange(4))
    points_m = np.stack([x.ravel(), y.ravel(), np.zeros(24)], axis=1).astype(np.float32) * 0.04
    pixels = cv2.projectPoints(points_m, np.zeros(3), np.array([-0.1, -0.06, 0.5]), K, None)[0]
    view = BoardView("", points_m, pixels.reshape(-1, 2).astype(np.float32))
    views = [dataclasses.replace(view, name=str(number)) for number in range(6)]
    with pytest.raises(ConfigError, match=r"fix no camera.*different tilts"):
        calibrate(views, (640, 480), lens)
