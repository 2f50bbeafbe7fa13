"""Pictures of calibration boards through a lens that is known exactly."""

import functools

import cv2
import numpy as np

from dfvs_core.geometry.camera import homogeneous
from dfvs_core.geometry.poses import make_pose, rotation_from_euler

SQUARE_PX = 48
MARGIN_PX = 48


@functools.cache
def _rays(camera):
    """Rays (2H, 2W, 3) of four samples a pixel."""
    fine = camera.scaled(2 * camera.width, 2 * camera.height)
    return homogeneous(fine.normalise(fine.grid()))


def board_picture(board, camera, T_camera_board, rng):
    """(H, W, 3) uint8: the board before grey, by ray tracing with 2 x 2 samples a pixel.

    The board's origin is its middle; its x is right and its y down.
    """
    spec = board.spec
    texture = board.draw(SQUARE_PX, MARGIN_PX).astype(np.float32)
    rays = _rays(camera)
    R, t = T_camera_board[:3, :3], T_camera_board[:3, 3]
    depth = (R[:, 2] @ t) / (rays @ R[:, 2])
    points = (rays * depth[..., None] - t) @ R  # on the board, m
    per_m = SQUARE_PX / spec.square_m
    u = points[..., 0] * per_m + texture.shape[1] / 2 - 0.5
    v = points[..., 1] * per_m + texture.shape[0] / 2 - 0.5
    seen = cv2.remap(
        texture, u.astype(np.float32), v.astype(np.float32), cv2.INTER_LINEAR, borderValue=128.0
    )
    seen[depth <= 0] = 128.0
    grey = 20 + 0.8 * cv2.resize(seen, camera.size, interpolation=cv2.INTER_AREA)
    grey = grey + rng.normal(0, 2.0, grey.shape)
    return np.repeat(np.clip(grey, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def board_poses(camera, board, count, rng, inside=0.35):
    """``T_camera_board`` of views towards the image's corners, at tilts of up to 35 degrees.

    ``inside`` is the share of the board's width that stays between its middle and the edge.
    """
    width_m = board.spec.columns * board.spec.square_m
    poses = []
    for i in range(count):
        z = width_m * camera.fx / camera.width * rng.uniform(1.15, 1.9)
        reach = z / camera.fx * 0.5 * np.array(camera.size) - inside * width_m
        corner = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (0, 0)][i % 5])
        x, y = corner * np.maximum(reach, 0.0) * 1.1
        tilt = np.radians(rng.uniform(18, 35, 2)) * [(1, -1)[i % 2], (1, -1)[i // 2 % 2]]
        R = rotation_from_euler(tilt[0], tilt[1], rng.uniform(-0.3, 0.3))
        poses.append(make_pose(R, np.array([x, y, z])))
    return poses
