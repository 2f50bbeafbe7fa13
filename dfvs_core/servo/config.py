"""Settings of the servo law."""

from dataclasses import dataclass
from math import radians
from typing import Literal

from dfvs_core.messages.schema import setting

Law = Literal["hybrid", "pose", "mean", "current"]
DepthChoice = Literal["motion", "network", "fused", "flow", "constant", "given"]
BY_NETWORK = ("network", "fused")
"""Choices that need a depth network."""


@dataclass(frozen=True, slots=True)
class ServoConfig:
    """How correspondences become a velocity.

    Lengths in m, angles in rad, pixels in px.
    """

    law: Law = setting(
        "hybrid",
        "hybrid: pose from flow and depth while far, mean Jacobian when near; or one of "
        "pose, mean, current (the paper's) alone",
    )
    gain_far: float = setting(1.5, "gain while the goal is far, 1/s", low=0.01, high=5.0)
    gain_near: float = setting(2.5, "gain when the error is nearly gone, 1/s", low=0.01, high=5.0)
    gain_error: float = setting(
        0.3, "error (m + rad) at which the gain lies between the two", low=1e-3, high=10.0
    )
    response_s: float = setting(
        0.65, "how late the vehicle follows a velocity; predicted away, s", low=0.0, high=3.0
    )
    yaw_response_s: float = setting(0.5, "the same for the yaw rate, s", low=0.0, high=3.0)
    damping: float = setting(1e-3, "mu of the paper's Eq. (1)", low=0.0, high=1.0)
    stride_px: int = setting(8, "one correspondence is used every so many px", low=2, high=64)
    flow_noise_px: float = setting(
        0.3, "what the flow is wrong by when it is right, px", low=0.01, high=10.0
    )
    min_confidence: float = setting(0.3, "correspondences below are not used", low=0.0, high=1.0)
    depth: DepthChoice = setting(
        "motion",
        "where depth comes from: motion, network (of the goal image), fused (both), flow (the "
        "paper's), constant or given",
    )
    constant_depth_m: float = setting(
        3.0, "depth before anything is known, and of depth = 'constant', m", low=0.1, high=1000.0
    )
    flow_depth_alpha: float = setting(
        0.03, "alpha of depth = 'flow', m per unit of normalised flow", low=1e-6, high=100.0
    )
    max_horizontal_m_s: float = setting(0.5, "speed limit of the law", low=0.01, high=10.0)
    max_vertical_m_s: float = setting(0.3, "speed limit of the law", low=0.01, high=10.0)
    max_turn_rad_s: float = setting(
        radians(20.0), "turn rate limit of the law", low=radians(0.5), high=radians(180.0)
    )
    tolerance_m: float = setting(0.02, "goal reached below this distance, m", low=1e-4, high=10.0)
    tolerance_rad: float = setting(
        radians(0.5), "goal reached below this angle", low=radians(0.005), high=radians(180.0)
    )
    tolerance_px: float = setting(
        2.0, "goal reached only if the median residual is below this, px", low=0.05, high=100.0
    )
    min_overlap: float = setting(
        0.03, "share of the view that must show the goal; half to go on", low=0.0, high=1.0
    )
    min_inliers: float = setting(
        0.35, "share of the correspondences that must agree on one motion", low=0.0, high=1.0
    )
    max_residual: float = setting(
        0.5, "share of the flow that one motion may leave unexplained", low=0.01, high=1.0
    )
    min_matched_texture: float = setting(
        0.7,
        "share of the textured area that must match at the goal",
        low=0.0,
        high=1.0,
        formerly="min_likeness",
    )
    max_condition: float = setting(
        3e4, "condition number above which the law is blind in some direction", low=1.0, high=1e12
    )
    progress_s: float = setting(
        5.0, "the goal counts as lost if the error does not fall for so long, s", low=0.5, high=600
    )
