"""Position-based visual servoing: the goal's pose from flow and true depth, then a straight way.

Every correspondence with depth is a point in space and where the goal image shows it; the pose
is found by perspective-n-point with random sampling, and refined (Chaumette and Hutchinson 2006,
IV, for the law).
"""

import cv2
import numpy as np

from dfvs_bench.methods.method import Decision, GoalObservation, Observation
from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.geometry.arrays import Float32Array, FloatArray, IntArray
from dfvs_core.geometry.camera import CameraModel, homogeneous
from dfvs_core.geometry.poses import invert_pose, make_pose, se3_exp, se3_log
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.matcher import Matcher, track_or_match
from dfvs_core.matching.warping import flow_at_size
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.points import points_from_flow, sample_grid

ITERATIONS = 200
_GAIN = 0.1
_STRIDE_PX = 8
_GRID = (slice(_STRIDE_PX // 2, None, _STRIDE_PX),) * 2
_LEAST_CONFIDENCE = 0.3
LEAST_POINTS = 8
"""Correspondences that a pose must stand on."""

REPROJECTION_PX = 3.0
_WIDTH_PX = 320.0
"""Width of the image at which :func:`pose_with_depth` takes that."""
_SAMPLES = 300
_FAILURES = 5
_AT_GOAL_M, _AT_GOAL_RAD = 0.005, 0.002


class PnpMethod:
    """Goes straight to where perspective-n-point says that the goal is.

    Of the goal only image and intrinsics are used.
    """

    def __init__(self, goal: GoalObservation, matcher: Matcher) -> None:
        self._camera = goal.camera
        self._matcher = matcher
        self._goal = matcher.encode(goal.image)
        self._last_flow: FlowField | None = None
        self._failed = 0

    def decide(self, observation: Observation) -> Decision:
        """A tenth of the way to the goal; without a pose the camera stays."""
        flow = track_or_match(
            self._matcher, self._matcher.encode(observation.image), self._goal, self._last_flow
        )
        T_current_goal = self._goal_pose(flow, observation)
        if T_current_goal is None:
            self._failed += 1
            self._last_flow = None
            lost = "no pose explains the flow" if self._failed >= _FAILURES else ""
            return Decision(np.eye(4), float("inf"), lost=lost)
        self._failed, self._last_flow = 0, flow
        twist = se3_log(T_current_goal)
        distance_m, angle_rad = np.linalg.norm(twist[:3]), np.linalg.norm(twist[3:])
        confident = flow.confidence > _LEAST_CONFIDENCE
        error_px = float(np.median(np.linalg.norm(flow.flow[confident], axis=1)))
        done = bool(distance_m < _AT_GOAL_M and angle_rad < _AT_GOAL_RAD)
        return Decision(se3_exp(_GAIN * twist), error_px, done)

    def _goal_pose(self, flow: FlowField, observation: Observation) -> FloatArray | None:
        """Goal camera in the current one (4, 4), or None."""
        flow = flow_at_size(flow, (self._camera.height, self._camera.width))
        P, xy_goal = _confident_points(flow, observation.depth, self._camera)
        found = perspective_pose(P, xy_goal, REPROJECTION_PX / self._camera.fx)
        return None if found is None else found[0]


def pose_with_depth(
    flow: FlowField, depth_m: Float32Array, camera: CameraModel
) -> FloatArray | None:
    """``T_current_goal`` (4, 4), m, by the flow from the current view to the goal.

    None where the service would refuse the frame: too few of the points are confident, or too few
    of those agree on a pose. The depth (H, W) is of the current view, as is ``camera``; 0 is sky.
    """
    config = ServoConfig()
    height, width = flow.confidence.shape
    camera = camera.scaled(width, height)
    depth_m = np.asarray(cv2.resize(depth_m, (width, height), interpolation=cv2.INTER_NEAREST))
    depth = DepthMap(np.maximum(depth_m, np.float32(1e-3)), (depth_m > 0).astype(np.float32))
    P, xy_goal = _confident_points(flow, depth, camera)
    if len(P) < config.min_overlap * depth_m[_GRID].size:
        return None
    tolerance = REPROJECTION_PX * camera.width / _WIDTH_PX / camera.fx
    pose = perspective_pose(P, xy_goal, tolerance)
    if pose is None or len(pose[1]) < config.min_inliers * len(P):
        return None
    return pose[0]


def _confident_points(
    flow: FlowField, depth: DepthMap, camera: CameraModel
) -> tuple[FloatArray, FloatArray]:
    """Points (N, 3) m in the current optical frame, and (N, 2) normalised in the goal image.

    Those on a grid whose flow (H, W) to the goal is confident and whose depth (H, W) is valid.
    """
    depth = DepthMap(depth.z_m[_GRID], depth.validity[_GRID])
    points = points_from_flow(sample_grid(flow, _STRIDE_PX), depth, camera, camera)
    points = points.select((depth.validity.ravel() > 0) & (points.weight > _LEAST_CONFIDENCE))
    return homogeneous(points.xy) * points.z_m[:, None], points.xy_goal


def perspective_pose(
    P: FloatArray, xy_goal: FloatArray, tolerance: float
) -> tuple[FloatArray, IntArray] | None:
    """``T_current_goal`` (4, 4) and indices of the points that agree; None where under eight do.

    ``P`` (N, 3) are points in the current optical frame, m; ``xy_goal`` (N, 2) are where the goal
    image shows them, normalised, and within ``tolerance`` of which they agree.
    """
    if len(P) < LEAST_POINTS:
        return None
    cv2.setRNGSeed(0)
    try:
        found, turn, shift, agreeing = cv2.solvePnPRansac(
            np.ascontiguousarray(P),
            np.ascontiguousarray(xy_goal),
            np.eye(3),
            None,
            iterationsCount=_SAMPLES,
            reprojectionError=tolerance,
            flags=cv2.SOLVEPNP_SQPNP,
        )
    except cv2.error:  # OpenCV's way to say that the points lie in one spot
        return None
    if not found or agreeing is None or len(agreeing) < LEAST_POINTS:
        return None
    R = np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64)
    T_goal_current = make_pose(R, np.asarray(shift, dtype=np.float64).ravel())
    return invert_pose(T_goal_current), np.asarray(agreeing, dtype=np.intp).ravel()
