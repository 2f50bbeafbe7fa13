"""Cheap scene: one textured wall, rendered by a single warp.

The wall stands 3 m north of the scene's origin (NED), facing south; its texture's columns go
east, its rows down. A camera at the origin that looks north sees the goal image.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from dfvs_core.geometry.arrays import FloatArray, ImageArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import Mount
from dfvs_sim.camera.sensor import SensorNoise

WALL_NORTH_M = 3.0
PX_PER_M = 50.0
_WIDTH_M, _HEIGHT_M = 14.0, 11.0
_NOISE_LEVELS = 2.0
_RAMP_M = 9.0
"""Width over which the ramp goes from black to full colour."""

NEUTRAL_BLUE = 128
"""Blue of the ramp wall; other values tell the network of ``network.py`` to misbehave."""


def noise_texture(rng: np.random.Generator) -> ImageArray:
    """Colourful texture (H, W, 3) with detail at every scale."""
    height, width = round(_HEIGHT_M * PX_PER_M), round(_WIDTH_M * PX_PER_M)
    total = np.zeros((height, width, 3), np.float32)
    scale = 3
    while scale < width / 2:
        cells = (height // scale + 2, width // scale + 2, 3)
        coarse = rng.normal(size=cells).astype(np.float32)
        total += cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC) * scale**0.5
        scale *= 2
    low, high = np.percentile(total, [0.1, 99.9])
    levels = 10.0 + (total - low) / (high - low) * 235.0
    return np.asarray(np.clip(levels, 0, 255), np.uint8)


def ramp_texture() -> ImageArray:
    """Texture (H, W, 3) whose red grows towards the east and whose green grows downwards."""
    height, width = round(_HEIGHT_M * PX_PER_M), round(_WIDTH_M * PX_PER_M)
    east = (np.arange(width) + 0.5 - width / 2) / PX_PER_M
    down = (np.arange(height) + 0.5 - height / 2) / PX_PER_M
    red, green = np.meshgrid(east, down)
    blue = np.full_like(red, NEUTRAL_BLUE)
    ramp = [127.5 + 255.0 / _RAMP_M * axis for axis in (red, green)]
    return np.asarray(np.clip(np.stack([*ramp, blue], axis=-1), 0, 255), np.uint8)


@dataclass(frozen=True, slots=True)
class Pose:
    """Pose of the vehicle's body in the scene: position NED in m, attitude in rad."""

    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rad: float = 0.0

    def T_scene_camera(self) -> FloatArray:
        """Pose (4, 4) of a camera that looks straight ahead."""
        x, y, z = self.position_m
        # A mounting is a pose in FRD from the same three angles.
        return Mount(x, y, z, self.roll_rad, self.pitch_rad, self.yaw_rad).T_body_camera()


class Wall:
    """Renders a texture (H, W, 3), uint8 RGB, on the wall for a camera without distortion.

    ``rng`` makes a sensor's noise.
    """

    def __init__(self, texture: ImageArray, camera: CameraModel, rng: np.random.Generator) -> None:
        self.texture = texture
        self.camera = camera
        height, width = texture.shape[:2]
        scale = 1.0 / PX_PER_M
        self._texture_to_metres = np.array(
            [[scale, 0, -width * scale / 2], [0, scale, -height * scale / 2], [0, 0, 1.0]]
        )
        self._noise = SensorNoise.make(camera.size, _NOISE_LEVELS, rng)
        self._rng = rng

    def render(self, pose: Pose) -> ImageArray:
        """Image (H, W, 3) uint8 RGB without noise."""
        c = self.camera
        K = np.array([[c.fx, 0, c.cx - 0.5], [0, c.fy, c.cy - 0.5], [0, 0, 1.0]])
        T = pose.T_scene_camera()
        R, p = T[:3, :3].T, T[:3, 3]
        to_wall = np.array([WALL_NORTH_M, 0.0, 0.0]) - p
        plane = np.column_stack([R[:, 1], R[:, 2], R @ to_wall])  # east, down, offset
        image = cv2.warpPerspective(
            self.texture,
            K @ plane @ self._texture_to_metres,
            c.size,
            flags=cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REFLECT,
        )
        return np.asarray(image, np.uint8)

    def capture(self, pose: Pose) -> ImageArray:
        """Image with noise: no two are the same."""
        return self._noise.apply(self.render(pose), self._rng)
