"""Verification of a match hypothesis by two-view geometry and appearance.

A still scene moves by one fundamental matrix, so right matches lie on its epipolar lines
(MAGSAC++, Barath et al., CVPR 2020). Repeated structures do so too; but where the hypothesis is
right, nearly all that has texture and is in view of both images matches.
"""

import cv2
import numpy as np

from dfvs_core.geometry.arrays import BoolArray, Float32Array, ImageArray
from dfvs_core.matching.config import PATCH_PX, MatchingConfig
from dfvs_core.matching.correspondence import CONFIDENT, FlowField
from dfvs_core.matching.points import PointMatches
from dfvs_core.matching.warping import lands_inside


def fit_two_views(matches: PointMatches, config: MatchingConfig) -> PointMatches | None:
    """Inliers of the two-view geometry that explains most matches; None where there is none.

    The same matches, in px of the working size, give the same inliers.
    """
    if len(matches) < config.least_matches:
        return None
    current, other = (at.astype(np.float64) for at in (matches.current, matches.other))
    try:
        _, mask = cv2.findFundamentalMat(current, other, cv2.USAC_MAGSAC, config.noise_px)
    except cv2.error:  # all points lead to nearly the same one, say
        return None
    if mask is None or np.count_nonzero(mask) < config.least_matches:
        return None
    return matches.select(mask.ravel() > 0)


def has_texture(grey: ImageArray, config: MatchingConfig | None = None) -> BoolArray:
    """(H, W): whether the patch around a pixel of a grey image could be matched."""
    u, v = (cv2.Sobel(grey, cv2.CV_32F, *order) for order in ((1, 0), (0, 1)))
    square = cv2.blur(u * u + v * v, (PATCH_PX + 1, PATCH_PX + 1))
    return np.asarray(square > (config or MatchingConfig()).least_gradient ** 2)


def explained_ratio(
    current: ImageArray, predicted: Float32Array, field: FlowField, config: MatchingConfig
) -> float:
    """Share of the texture in view of both images that is confidently matched.

    ``current`` is grey (H, W), ``predicted`` the hypothesis' flow (H, W, 2), ``field`` found by it.
    """
    in_both: BoolArray = has_texture(current, config) & lands_inside(predicted)
    if not in_both.any():
        return 0.0
    return float(np.mean(field.confidence[in_both] > CONFIDENT))
