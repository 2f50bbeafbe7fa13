"""A textured wall seen from many sides: pictures of it and the exact flow between them."""

from dataclasses import dataclass

import cv2
import numpy as np

WIDTH, HEIGHT = 320, 240
_MARGIN = 280


def texture(rng, height=HEIGHT + 2 * _MARGIN, width=WIDTH + 2 * _MARGIN, finest_px=3):
    """Random (H, W, 3) float32, 0..255, with detail at every scale from ``finest_px`` up."""
    total = np.zeros((height, width, 3), np.float32)
    scale = finest_px
    while scale < width / 2:
        cells = (height // scale + 2, width // scale + 2, 3)
        noise = rng.normal(size=cells).astype(np.float32)
        total += cv2.resize(noise, (width, height), interpolation=cv2.INTER_CUBIC) * scale**0.5
        scale *= 2
    low, high = np.percentile(total, [0.1, 99.9])
    return np.clip(10.0 + (total - low) / (high - low) * 235.0, 0.0, 255.0)


def turned(roll_deg=0.0, zoom=1.0, shift=(0.0, 0.0), perspective=(0.0, 0.0)):
    """Homography (3, 3) about the picture's centre; shift in px, perspective in 1/px."""
    c, s = np.cos(np.radians(roll_deg)) * zoom, np.sin(np.radians(roll_deg)) * zoom
    centre = np.array([[1, 0, (WIDTH - 1) / 2], [0, 1, (HEIGHT - 1) / 2], [0, 0, 1.0]])
    H = np.array([[c, -s, shift[0]], [s, c, shift[1]], [perspective[0], perspective[1], 1.0]])
    return centre @ H @ np.linalg.inv(centre)


@dataclass(frozen=True)
class Wall:
    """``H`` everywhere below takes picture a's points (OpenCV px) to picture b's."""

    texture: np.ndarray

    def picture(self, H=None, gain=1.0, offset=0.0):
        """(240, 320, 3) uint8: picture a, or b for the homography ``H``."""
        H = np.eye(3) if H is None else H
        to_texture = np.array([[1, 0, _MARGIN], [0, 1, _MARGIN], [0, 0, 1.0]])
        fine = np.array([[2, 0, 0.5], [0, 2, 0.5], [0, 0, 1.0]])
        twice = cv2.warpPerspective(
            self.texture,
            fine @ H @ np.linalg.inv(to_texture),
            (2 * WIDTH, 2 * HEIGHT),
            flags=cv2.INTER_CUBIC,
            borderMode=cv2.BORDER_REFLECT,
        )
        small = cv2.resize(twice, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
        return np.clip(gain * small + offset, 0, 255).astype(np.uint8)


def exact_flow(H):
    """Flow (240, 320, 2) from a to b."""
    u, v = np.meshgrid(np.arange(WIDTH, dtype=float), np.arange(HEIGHT, dtype=float))
    grid = np.stack([u, v], axis=-1)
    return cv2.perspectiveTransform(grid.reshape(-1, 1, 2), H).reshape(grid.shape) - grid


def inside(flow, margin=2.0):
    """(H, W): where a flow leads well inside the other picture."""
    u, v = np.meshgrid(np.arange(WIDTH, dtype=float), np.arange(HEIGHT, dtype=float))
    u, v = u + flow[..., 0], v + flow[..., 1]
    along_u = (u > margin) & (u < WIDTH - 1 - margin)
    return along_u & (v > margin) & (v < HEIGHT - 1 - margin)


def errors(field, truth):
    """End-point error (H, W) px."""
    return np.linalg.norm(field.flow - truth, axis=-1)
