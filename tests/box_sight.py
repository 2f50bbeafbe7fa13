"""Pictures that name their pose, and a matcher that knows the flow between them exactly."""

import numpy as np
from box_room import BoxRoom, PosedMatcher

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import R_BODY_FORWARD_CAMERA, make_pose, rotation_from_euler

CAMERA = CameraModel.from_horizontal_fov(96, 72, 1.4)
ROOM = BoxRoom(CAMERA)
MS = 1_000_000
CLOCK = b"c" * 16


def pose(yaw_deg):
    R = rotation_from_euler(0.0, 0.0, np.radians(yaw_deg)) @ R_BODY_FORWARD_CAMERA
    return make_pose(R, np.zeros(3))


class KnowingMatcher(PosedMatcher):
    """Exact flow between the poses that the pictures name.

    Their first two bytes tell the heading: 0.01 degrees a unit.
    """

    def __init__(self):
        super().__init__(ROOM, lambda: 0.0)

    def encode(self, image):
        self.T_world_camera = pose((int(image[0, 0, 0]) * 256 + int(image[0, 0, 1])) * 0.01)
        return super().encode(image)


def picture(yaw_deg):
    """Noise, with the heading in its first pixel."""
    image = np.random.default_rng(0).integers(0, 255, (72, 96, 3)).astype(np.uint8)
    image[0, 0, :2] = divmod(round(yaw_deg * 100), 256)
    return image
