"""Depth source by its configured name."""

from dfvs_core.depth.flow_depth import FlowDepth
from dfvs_core.depth.motion import MotionDepth
from dfvs_core.depth.source import ConstantDepth, DepthSource, GivenDepth
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.servo.config import ServoConfig


def depth_source(config: ServoConfig, camera: CameraModel) -> DepthSource:
    """Build the source for ``config.depth``; the camera sets the noise of a correspondence."""
    if config.depth == "given":
        return GivenDepth()
    if config.depth == "constant":
        return ConstantDepth(config.constant_depth_m)
    noise = 1.5 * config.flow_noise_px / camera.fx
    if config.depth == "flow":
        return FlowDepth(config.flow_depth_alpha, fallback_m=config.constant_depth_m, noise=noise)
    return MotionDepth(prior=config.constant_depth_m, pixel_noise=noise)
