"""A board in front of a wall, seen by a camera that moves: pictures and the exact flow."""

from functools import cached_property

import cv2
import numpy as np
from textured_wall import HEIGHT, WIDTH, Wall, exact_flow, texture

_K = np.array([[250.0, 0, (WIDTH - 1) / 2], [0, 250.0, (HEIGHT - 1) / 2], [0, 0, 1.0]])
_WALL_M, _BOARD_M = 4.0, 2.0
_BOARD = (slice(40, 200), slice(170, 290))
"""Rows and columns of the board in the first picture."""


_STEP_M, _TURN_RAD = np.array([0.5, 0.1, 0.3]), np.array([0.02, -0.1, 0.05])
"""Of the second camera from the first."""


class TwoPlanes:
    """The view, worked out when it is asked for."""

    @cached_property
    def board(self):
        """(H, W) in the first picture."""
        mask = np.zeros((HEIGHT, WIDTH), bool)
        mask[_BOARD] = True
        return mask

    def homography(self, depth_m):
        """From the first picture to the second, of a plane facing the first camera."""
        R, _ = cv2.Rodrigues(_TURN_RAD)
        n = np.array([0.0, 0.0, 1.0])
        return _K @ (R - np.outer(R @ _STEP_M, n) / depth_m) @ np.linalg.inv(_K)

    @cached_property
    def flow(self):
        """(H, W, 2) px, exact."""
        wall, board = (exact_flow(self.homography(z)) for z in (_WALL_M, _BOARD_M))
        return np.where(self.board[..., None], board, wall).astype(np.float32)

    @cached_property
    def pictures(self):
        """Both (H, W, 3) uint8."""
        rng = np.random.default_rng(4)
        wall, board = (Wall(texture(rng, finest_px=4)) for _ in range(2))
        first = np.where(self.board[..., None], board.picture(), wall.picture())
        near, far = self.homography(_BOARD_M), self.homography(_WALL_M)
        there = cv2.warpPerspective(self.board.astype(np.uint8), near, (WIDTH, HEIGHT)) > 0
        second = np.where(there[..., None], board.picture(near), wall.picture(far))
        return first, second
