"""Parameters of dense matching."""

import math
from dataclasses import dataclass

PATCH_PX = 8
"""Side of a patch of OpenCV's DISOpticalFlow. Windows and cells are as large."""


@dataclass(frozen=True, slots=True)
class MatchingConfig:
    """Everything in ``dfvs_core.matching`` that was chosen by measurement."""

    working_width_px: int = 320
    """Width at which images of 4:3 are searched; others at as many pixels, none enlarged."""
    turns_rad: tuple[float, ...] = (0.0, math.radians(-45.0), math.radians(45.0))
    """Angles by which the other image is turned in a relocalisation."""
    scales: tuple[float, ...] = (1.0, 0.5)
    """Factors by which it is reduced."""
    most_hypotheses: int = 2
    """Hypotheses for which a dense flow is searched."""
    growing_rounds: int = 2
    """Dense searches from what the one before has confirmed."""
    least_matches: int = 12
    """Matches that a two-view geometry or a smooth flow is fitted to."""
    noise_px: float = 1.0
    """Standard deviation of a match, px of the working size. Limits are multiples of it."""
    same_sigmas: float = 3.0
    """Distance within which two matches lead to the same place, in standard deviations."""
    residual_sigmas: float = 6.0
    """Distance of a match from the smooth flow at which it counts less, in standard deviations."""
    damping: float = 0.15
    """Weight of no residual and of no slope, in matches at the same place and one sigma aside."""
    least_gradient: float = 15.0
    """Size of Sobel's gradient, in the mean of a patch, from which on it has texture."""
    least_explained_ratio: float = 0.1
    """Share of the texture in view of both images that a match has to explain."""
    kept_ratio: float = 1.0 / 3.0
    """Share of the confident area of a prediction that has to be confident again."""
    least_confident_ratio: float = 0.05
    """Confident share of the image that a match or a track has to have."""
    sift_width_px: int = 640
    """Largest width at which the classical matcher finds keypoints."""
    sift_count: int = 3000
    """Keypoints of an image, at most."""
    sift_ratio: float = 0.9
    """Distance of the nearest descriptor, in distances of the second, of a match."""

    def working_size(self, size: tuple[int, int]) -> tuple[int, int]:
        """Size (height, width) at which the dense search runs, of an image of ``size``, px."""
        height, width = size
        scale = min(1.0, self.working_width_px * math.sqrt(0.75 / (height * width)))
        return round(height * scale), round(width * scale)

    @property
    def same_px(self) -> float:
        """Distance within which two matches lead to the same place, px of the working size."""
        return self.same_sigmas * self.noise_px
