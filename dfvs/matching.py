"""Matching of two images."""

from dataclasses import dataclass

import numpy as np

from dfvs_core.errors import ImageError
from dfvs_core.geometry.arrays import FloatArray, ImageArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.matcher import Matcher
from dfvs_core.matching.relative_pose import RelativePose, relative_pose
from dfvs_core.matching.warping import flow_at_size, pixel_grid


@dataclass(frozen=True, slots=True)
class ImageMatch:
    """Correspondences of two images, and the relative pose of their cameras.

    Parameters
    ----------
    flow : FlowField
        ``flow.flow`` (H, W, 2) float32 px and ``flow.confidence`` (H, W) float32, 0 to 1, at the
        size of the images: pixel p of the first is seen at ``p + flow`` in the second.
    pose : RelativePose or None
        Of the second camera in the first one's optical frame, up to scale. None without
        intrinsics, where too few matches agree, or where the cameras are at the same place.
    """

    flow: FlowField
    pose: RelativePose | None

    def points(self, min_confidence: float = 0.5) -> tuple[FloatArray, FloatArray]:
        """Matched points of both images.

        Parameters
        ----------
        min_confidence : float
            Pixels of a lower confidence are left out.

        Returns
        -------
        first, second : (N, 2) float64
            (u, v) px; the centre of the first pixel is at (0.5, 0.5), as in :class:`CameraModel`.
        """
        kept = self.flow.confidence >= min_confidence
        first = pixel_grid(kept.shape)[kept].astype(np.float64) + 0.5
        return first, first + self.flow.flow[kept]


def match_images(
    matcher: Matcher,
    first: ImageArray,
    second: ImageArray,
    camera: CameraModel | None = None,
    second_camera: CameraModel | None = None,
) -> ImageMatch:
    """Match two images without a prior.

    Parameters
    ----------
    matcher : Matcher
        Of :func:`load_matcher`.
    first, second : (H, W, 3) uint8
        RGB, of one size, 32 px or more.
    camera : CameraModel, optional
        Intrinsics; with them the relative pose is estimated.
    second_camera : CameraModel, optional
        Intrinsics of the second image, where it was taken by another camera.

    Returns
    -------
    ImageMatch
        Where nothing matches, the confidence is 0 everywhere and ``pose`` is None.

    Raises
    ------
    ImageError
        If an image is not (H, W, 3) uint8, their sizes differ, or one is not of its camera's size.

    Examples
    --------
    >>> import cv2, numpy as np
    >>> import dfvs
    >>> noise = np.random.default_rng(0).integers(0, 256, (240, 320, 3), np.uint8)
    >>> first = cv2.GaussianBlur(noise, (0, 0), 2.0)
    >>> second = np.roll(first, 12, axis=1)
    >>> match = dfvs.match_images(dfvs.load_matcher("classical"), first, second)
    >>> match.flow.flow.shape, match.flow.confidence.shape
    ((240, 320, 2), (240, 320))
    >>> at_first, at_second = match.points()
    >>> round(float(np.median(at_second[:, 0] - at_first[:, 0])), 1)
    12.0
    """
    encoded = matcher.encode(first), matcher.encode(second)
    (height, width), size = first.shape[:2], second.shape[:2]
    if size != (height, width):
        raise ImageError(
            f"images of {width} x {height} and {size[1]} x {size[0]} px", "one size for both"
        )
    flow = matcher.match(*encoded)
    pose = None
    if camera is not None:
        second_camera = second_camera or camera
        camera.check_size(first, "the first image")
        second_camera.check_size(second, "the second image")
        pose = relative_pose(flow, camera, second_camera)
    return ImageMatch(flow_at_size(flow, (height, width)), pose)
