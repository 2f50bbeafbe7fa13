"""Camera model: pinhole with OpenCV's radial-tangential distortion.

Pixel coordinates have their origin at the corner of the image, so the centre of the first pixel
is (0.5, 0.5) and an image of width W is symmetric about ``cx = W / 2``. Normalised coordinates
are x = X / Z, y = Y / Z in the optical frame.
"""

from __future__ import annotations

import operator
from dataclasses import dataclass, fields

import cv2
import numpy as np

from dfvs_core.errors import GeometryError, ImageError
from dfvs_core.geometry.arrays import FloatArray, ImageArray, check_image
from dfvs_core.geometry.distortion import first_folds

_DISTORTION_LENGTHS = (0, 4, 5, 8)
_SAME_CAMERA = 0.02
"""Relative difference of two calibrations that are of the same camera."""
_AROUND_RAD = np.linspace(0.0, 2.0 * np.pi, 36, endpoint=False)
"""Directions in which, beside the corners', a distortion is examined."""
_UNDISTORT_CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 1000, 1e-10)


def homogeneous(xy: FloatArray) -> FloatArray:
    """Rays (..., 3), z = 1, of normalised coordinates (..., 2)."""
    return np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1)


@dataclass(frozen=True, slots=True)
class CameraModel:
    """Intrinsics of a camera.

    Parameters
    ----------
    width, height : int
        Image size in px.
    fx, fy, cx, cy : float
        Focal lengths and principal point in px; the first pixel's centre is (0.5, 0.5).
    distortion : tuple of float
        OpenCV's (k1, k2, p1, p2[, k3[, k4, k5, k6]]), or empty for a pinhole. OpenCV's own arrays
        are accepted, as NumPy's numbers are for the others.

    Raises
    ------
    GeometryError
        If no camera can have such intrinsics, or the distortion folds back within the image.

    Examples
    --------
    >>> camera = CameraModel(640, 480, fx=500.0, fy=500.0, cx=320.0, cy=240.0)
    >>> camera.project(np.array([0.5, 0.0, 2.0])).tolist()
    [445.0, 240.0]
    >>> camera.scaled(320, 240).fx
    250.0
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Make plain numbers of NumPy's, and refuse intrinsics that no camera can have."""
        self._make_plain()
        if self.width < 16 or self.height < 16:
            raise GeometryError(f"image size {self.width} x {self.height} px", "16 x 16 or more")
        values = (self.fx, self.fy, self.cx, self.cy, *self.distortion)
        if not np.isfinite(values).all():
            raise GeometryError(f"intrinsics {values} are not all finite")
        if self.fx <= 0 or self.fy <= 0:
            raise GeometryError(f"focal lengths {self.fx}, {self.fy} px", "positive numbers")
        if not (0 < self.cx < self.width and 0 < self.cy < self.height):
            raise GeometryError(
                f"principal point ({self.cx}, {self.cy}) px lies outside the image",
                f"0 < cx < {self.width} and 0 < cy < {self.height}",
            )
        if len(self.distortion) not in _DISTORTION_LENGTHS:
            raise GeometryError(
                f"{len(self.distortion)} distortion coefficients", "0, 4, 5 or 8 (OpenCV's order)"
            )
        if any(self.distortion):
            self._check_invertible()

    def _make_plain(self) -> None:
        """Turn the fields into int, float and a flat tuple of float."""
        given = {field.name: getattr(self, field.name) for field in fields(self)}
        distortion = given.pop("distortion")
        try:
            plain = {
                name: operator.index(value) if name in ("width", "height") else float(value)
                for name, value in given.items()
            }
            coefficients = np.atleast_1d(np.squeeze(np.asarray(distortion, dtype=np.float64)))
        except (TypeError, ValueError) as error:
            raise GeometryError(
                f"intrinsics {(*given.values(), distortion)} ({error})",
                "integers of px for the image size, and numbers",
            ) from error
        if coefficients.ndim != 1:
            raise GeometryError(f"distortion of shape {coefficients.shape}", "one row or column")
        for name, value in plain.items():
            object.__setattr__(self, name, value)
        object.__setattr__(self, "distortion", tuple(coefficients.tolist()))

    def _check_invertible(self) -> None:
        """Refuse a distortion that folds back before it has reached the image's corners."""
        size, centre = np.array(self.size), np.array([self.cx, self.cy])
        corners = np.array([(0.0, 0.0), (size[0], 0.0), size, (0.0, size[1])]) - centre
        to_corners = np.arctan2(corners[:, 1] / self.fy, corners[:, 0] / self.fx)
        folds = first_folds(self.distortion, np.concatenate([to_corners, _AROUND_RAD]))
        if not len(folds):
            return
        pixels = self.denormalise(folds)
        is_seen = ((pixels > 0.0) & (pixels < size)).all(axis=-1)
        if not is_seen.any():
            return
        radii, radii_px = np.linalg.norm(folds, axis=-1), np.linalg.norm(pixels - centre, axis=-1)
        nearest = np.where(is_seen, radii, np.inf).argmin()
        coefficients = ", ".join(f"{value:g}" for value in self.distortion)
        raise GeometryError(
            f"distortion ({coefficients}) folds back in the image, {radii_px[nearest]:.0f} px from "
            "the principal point, where a ray is "
            f"{np.degrees(np.arctan(radii[nearest])):.0f} degrees off the axis",
            f"one that rises up to the corner, {np.linalg.norm(corners, axis=-1).max():.0f} px off",
            "calibrate again with points up to the image's corners, or with fewer coefficients",
        )

    @classmethod
    def from_horizontal_fov(cls, width: int, height: int, fov_rad: float) -> CameraModel:
        """Pinhole with square pixels and a centred principal point; fov_rad is horizontal."""
        if not 0 < fov_rad < np.pi:
            raise GeometryError(
                f"horizontal field of view {np.degrees(fov_rad):.1f} degrees", "between 0 and 180"
            )
        f = 0.5 * width / np.tan(0.5 * fov_rad)
        return cls(width, height, f, f, 0.5 * width, 0.5 * height)

    @property
    def matrix(self) -> FloatArray:
        """Intrinsic matrix K (3, 3) in our pixel convention."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in px."""
        return self.width, self.height

    def check_size(self, image: ImageArray, name: str, remedy: str = "") -> None:
        """Find that an image (H, W, 3), which ``name`` stands for, has the camera's size.

        Raises
        ------
        ImageError
            If it has not, or is not (H, W, 3) uint8.
        """
        check_image(image)
        height, width = image.shape[:2]
        if (width, height) != self.size:
            expected = f"{self.width} x {self.height} px, the size of its camera"
            raise ImageError(f"{name} has {width} x {height} px", expected, remedy)

    def scaled(self, width: int, height: int) -> CameraModel:
        """Return the same camera with its image resized to width x height px."""
        sx, sy = width / self.width, height / self.height
        return CameraModel(
            width, height, self.fx * sx, self.fy * sy, self.cx * sx, self.cy * sy, self.distortion
        )

    def normalise(self, pixels: FloatArray) -> FloatArray:
        """Undistorted normalised coordinates (..., 2) of pixels (..., 2), always finite.

        Outside of the image of a lens, where there may be no such ray, they mean nothing.
        """
        pixels = np.asarray(pixels, dtype=np.float64)
        distorted = (pixels - [self.cx, self.cy]) / [self.fx, self.fy]
        if not self.distortion:
            return distorted
        flat = np.ascontiguousarray(pixels.reshape(-1, 1, 2))
        out = cv2.undistortPoints(
            flat, self.matrix, np.array(self.distortion), None, None, None, _UNDISTORT_CRITERIA
        )
        xy = np.asarray(out, dtype=np.float64).reshape(pixels.shape)
        return np.where(np.isfinite(xy), xy, distorted)

    def project(self, points: FloatArray) -> FloatArray:
        """Pixels (..., 2) of points (..., 3) m in the optical frame with positive z."""
        points = np.asarray(points, dtype=np.float64)
        xy = points[..., :2] / points[..., 2:3]
        return self.denormalise(xy)

    def denormalise(self, xy: FloatArray) -> FloatArray:
        """Pixels (..., 2) of undistorted normalised coordinates (..., 2)."""
        xy = np.asarray(xy, dtype=np.float64)
        if not self.distortion:
            return xy * [self.fx, self.fy] + [self.cx, self.cy]
        rays = homogeneous(xy).reshape(-1, 1, 3)
        zero = np.zeros(3)
        pixels, _ = cv2.projectPoints(rays, zero, zero, self.matrix, np.array(self.distortion))
        return np.asarray(pixels, dtype=np.float64).reshape(xy.shape)

    def grid(self, stride: int = 1) -> FloatArray:
        """Pixel centres (h, w, 2) as (u, v), every stride-th one, centred in its cell."""
        offset = stride // 2
        u = np.arange(offset, self.width, stride) + 0.5
        v = np.arange(offset, self.height, stride) + 0.5
        return np.stack(np.meshgrid(u, v), axis=-1)


def calibration_difference(here: CameraModel, there: CameraModel, whose: str) -> str:
    """Say in what two calibrations differ more than two of one camera would; else empty.

    Parameters
    ----------
    here, there : CameraModel
        The camera that flies, and another one.
    whose : str
        Word for the other one.
    """
    if here.size != there.size:
        sizes = (*there.size, *here.size)
        return "the {} size is {} x {} px, here it is {} x {}".format(whose, *sizes)
    pairs = {
        "focal length": (here.fx, there.fx, here.fx),
        "vertical focal length": (here.fy, there.fy, here.fy),
        "principal point's x": (here.cx, there.cx, here.width),
        "principal point's y": (here.cy, there.cy, here.height),
    }
    for name, (own, other, scale) in pairs.items():
        if abs(own - other) > _SAME_CAMERA * scale:
            return f"the {whose} {name} is {other:.1f} px, here it is {own:.1f}"
    xy = here.normalise(here.grid(max(here.width // 8, 1)))
    shift_px = here.fx * np.linalg.norm(_distorted(here, xy) - _distorted(there, xy), axis=-1).max()
    if shift_px > _SAME_CAMERA * here.width:
        return f"the {whose} distortion differs from the one here by up to {shift_px:.1f} px"
    return ""


def _distorted(camera: CameraModel, xy: FloatArray) -> FloatArray:
    """Distorted normalised coordinates (..., 2)."""
    return (camera.denormalise(xy) - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
