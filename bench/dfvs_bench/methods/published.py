"""The law of the DFVS paper as its published code has it, as a baseline.

It differs from the paper and from ``dfvs_core``, and every difference is kept:

- cx and cy are exchanged, and fy is computed from the height;
- the error is in pixels, not divided by the focal length;
- the diagonal of the damping is added as a row to every row, so that it damps nothing;
- translation is applied in the camera's frame but rotation in the world's;
- the two-view depth is ``1 / Z = |flow(t, t-1)| + 1`` in px, with the true depth taken for its
  inverse in the first frame.

Gain 0.01, mu 0.03, 0.01 s a step, and an end by photometric error: squared differences of all three
colours are added up and divided by the number of pixels.

The paper takes its flow from FlowNet2; here it comes from the matcher that all methods share. An
error in pixels makes the gain a matter of the image's size: flow is brought to the size that the
authors set the gain for, 512 px wide.
"""

import numpy as np

from dfvs_bench.methods.method import Decision, GoalObservation, Observation
from dfvs_core.geometry.arrays import Float32Array, FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.interaction import interaction_matrix
from dfvs_core.geometry.poses import make_pose, so3_exp
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.matcher import ImageFeatures, Matcher, track_or_match
from dfvs_core.matching.warping import flow_at_size

ITERATIONS = 4000
"""The paper's longest run took 3831."""
_GAIN, _MU, _STEP_S = 0.01, 0.03, 0.01
_AUTHORS_WIDTH_PX = 512.0
_STRIDE_PX = 4
"""The code takes every pixel; every sixteenth one gives the same sums sixteen times faster."""

_SQUARED_ERROR_AT_GOAL = 500.0
"""Squared difference of a pixel's red, green and blue, in the mean, below which the code ends."""

_LONGEST_STEP = 0.5


class PublishedMethod:
    """The published code's law with its flow-depth; only image and intrinsics of the goal count."""

    def __init__(self, goal: GoalObservation, matcher: Matcher) -> None:
        self._goal_image = goal.image.astype(np.float64)
        self._matcher = matcher
        self._goal = matcher.encode(goal.image)
        self._camera = goal.camera
        self._xy = _code_coordinates(goal.camera)
        self._per_px = _AUTHORS_WIDTH_PX / goal.camera.width
        self._last: ImageFeatures | None = None
        self._flow: FlowField | None = None
        self._R_world_start: FloatArray | None = None

    def decide(self, observation: Observation) -> Decision:
        """One step of the published loop."""
        features = self._matcher.encode(observation.image)
        self._flow = track_or_match(self._matcher, features, self._goal, self._flow)
        flow = self._flow_px(self._flow)
        inverse_z = self._inverse_depth(features, observation)
        self._last = features
        L = interaction_matrix(self._xy, 1.0 / inverse_z).reshape(-1, 6)
        H = L.T @ L
        damped = H + _MU * np.diag(H)  # a row added to every row, as in the code
        step = np.linalg.lstsq(damped, L.T @ flow.ravel(), rcond=None)[0]
        twist = _STEP_S * _GAIN * np.asarray(step, dtype=np.float64)
        difference = observation.image.astype(np.float64) - self._goal_image
        squared = float(np.mean(np.sum(difference * difference, axis=2)))
        done = squared < _SQUARED_ERROR_AT_GOAL
        return Decision(self._moved(twist, observation), float(np.sqrt(squared)), done)

    def _inverse_depth(self, features: ImageFeatures, observation: Observation) -> FloatArray:
        """What the code takes for 1 / Z of every point (N,)."""
        if self._last is None:
            return _sampled(observation.depth.z_m).ravel()
        motion_px = self._flow_px(self._matcher.match(features, self._last))
        lengths: FloatArray = np.linalg.norm(motion_px.reshape(-1, 2), axis=1) + 1.0
        return lengths

    def _flow_px(self, field: FlowField) -> FloatArray:
        """Flow (h, w, 2) of the sampled pixels, in px of the authors' image size."""
        field = flow_at_size(field, (self._camera.height, self._camera.width))
        return _sampled(field.flow) * self._per_px

    def _moved(self, twist: FloatArray, observation: Observation) -> FloatArray:
        """Motion (4, 4): shifted along the camera's axes, turned about the first camera's."""
        R = observation.T_world_camera[:3, :3]
        if self._R_world_start is None:
            self._R_world_start = R
        R_start_camera = self._R_world_start.T @ R
        twist = twist * min(1.0, _LONGEST_STEP / max(float(np.abs(twist).max()), 1e-12))
        turn = R_start_camera.T @ so3_exp(twist[3:]) @ R_start_camera
        return make_pose(turn, twist[:3])


def _code_coordinates(camera: CameraModel) -> FloatArray:
    """What the code takes for normalised coordinates (N, 2) of the sampled pixels."""
    pixels = camera.grid()[::_STRIDE_PX, ::_STRIDE_PX].reshape(-1, 2)
    fy_of_code = camera.fx * camera.height / camera.width
    return (pixels - [camera.cy, camera.cx]) / [camera.fx, fy_of_code]


def _sampled(values: Float32Array) -> FloatArray:
    """Every fourth row and column of (H, W, ...)."""
    return np.asarray(values[::_STRIDE_PX, ::_STRIDE_PX], dtype=np.float64)
