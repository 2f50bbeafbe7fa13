"""Tunable numbers of dense matching."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MatchingConfig:
    """Everything in ``dfvs_core.matching`` that was chosen by measurement.

    Lengths are in px of the working size unless a name says otherwise.
    """

    working_width_px: int = 320
    """Largest width at which the dense search runs."""
    turns_rad: tuple[float, ...] = (0.0, math.radians(-45.0), math.radians(45.0))
    """Angles by which the other image is turned in a relocalisation."""
    scales: tuple[float, ...] = (1.0, 0.5)
    """Factors by which it is reduced."""

    # Dense inverse search (OpenCV's DISOpticalFlow)
    patch_stride_px: int = 4
    """From patch to patch of 8 px."""
    smoothness: float = 40.0
    """Weight of smoothness in the variational refinement."""
    forward_rounds: int = 8
    """Variational rounds of the flow that is used."""
    backward_rounds: int = 4
    """Variational rounds of the flow that only checks it."""

    # Confidence of a flow vector
    forward_backward_px: float = 1.0
    """Forward-backward error at which confidence is one half."""
    deviation_px: float = 4.0
    """Distance from the median residual motion at which confidence is one half."""
    correlation_radius_px: int = 4
    """Half side of the window of the normalised cross-correlation."""
    full_correlation: float = 0.8
    """Correlation from which on confidence is not reduced."""

    # Smooth flow through scattered matches
    cell_px: int = 8
    """Cell of the grid on which residuals are interpolated."""
    sigmas_cells: tuple[float, ...] = (8.0, 4.0, 2.0, 1.0)
    """Widths of the interpolation, from coarse to fine."""
    damping: float = 0.15
    """Weight of no residual at all, in matches at the same place."""
    slope_damping: float = 0.3
    """The same of no slope, per square of the width."""
    residual_px: float = 6.0
    """Scale of the robust weight of a residual at the finest width."""

    # Verification
    least_match_confidence: float = 0.1
    """Confidence below which a sparse match is dropped."""
    epipolar_px: float = 1.0
    """Distance from the epipolar line within which a match is an inlier."""
    least_matches: int = 12
    """Matches that a two-view geometry is fitted to."""
    most_hypotheses: int = 2
    """Hypotheses for which a dense flow is searched."""
    growing_rounds: int = 3
    """Dense searches from what the one before has confirmed."""
    logit: tuple[float, float, float] = (-2.0, 1.35, 1.05)
    """Constant, and weights of the logarithms of support and explained texture: probability."""
    clear_probability: float = 0.85
    """Probability from which on no further hypothesis is tried."""
    least_probability: float = 0.5
    """Probability below which a hypothesis gives no flow."""

    # Tracking
    kept_ratio: float = 0.5
    """Share of the confident area of the prediction that has to be confident again."""
    least_confident_ratio: float = 0.05
    """Confident share of the image that a track has to have."""
