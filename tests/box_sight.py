"""Pictures that name their pose, and a matcher that knows the flow between them exactly."""

import numpy as np
from box_room import BoxRoom

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import R_BODY_FORWARD_CAMERA, make_pose, rotation_from_euler
from dfvs_core.matching.matcher import ImageFeatures

CAMERA = CameraModel.from_horizontal_fov(96, 72, 1.4)
ROOM = BoxRoom(CAMERA)
MS = 1_000_000
CLOCK = b"c" * 16


def pose(yaw_deg):
    R = rotation_from_euler(0.0, 0.0, np.radians(yaw_deg)) @ R_BODY_FORWARD_CAMERA
    return make_pose(R, np.zeros(3))


class PictureOfPose(ImageFeatures):
    """A picture whose first two bytes tell the heading: 0.01 degrees a unit."""

    def __init__(self, image):
        super().__init__(image.shape[:2])
        self.T = pose((int(image[0, 0, 0]) * 256 + int(image[0, 0, 1])) * 0.01)


class KnowingMatcher:
    """Exact flow between the poses that the pictures name."""

    def encode(self, image):
        return PictureOfPose(image)

    def match(self, current, other, *, excluded=()):
        return ROOM.flow(current.T, other.T)

    def track(self, current, other, predicted):
        return ROOM.flow(current.T, other.T)

    def extend(self, current, other, known):
        return None


def picture(yaw_deg):
    """Noise, with the heading in its first pixel."""
    image = np.random.default_rng(0).integers(0, 255, (72, 96, 3)).astype(np.uint8)
    image[0, 0, :2] = divmod(round(yaw_deg * 100), 256)
    return image
