"""Classical image-based visual servoing on SIFT points, with true depth.

Chaumette and Hutchinson, "Visual servo control, part I", 2006: ``v = -gain L^+ (s - s*)`` with the
interaction matrix of the current points. Points are matched by Lowe's ratio test (0.8) and kept
where they agree, with their depth, on one rigid motion.
"""

import cv2
import numpy as np

from dfvs_bench.methods.method import Decision, GoalObservation, Observation
from dfvs_bench.methods.pnp import LEAST_POINTS, REPROJECTION_PX, perspective_pose
from dfvs_core.geometry.arrays import BoolArray, Float32Array, FloatArray, ImageArray
from dfvs_core.geometry.camera import homogeneous
from dfvs_core.geometry.interaction import interaction_matrix
from dfvs_core.geometry.poses import se3_exp
from dfvs_core.geometry.robust_weights import weighted_median
from dfvs_core.servo.law import normal_equations

ITERATIONS = 200
_GAIN = 0.1
_RATIO = 0.8
_FEATURES = 1000
_FAILURES = 5
_ERROR_AT_GOAL_PX = 0.2


class SiftMethod:
    """Image-based servoing on sparse points; of the goal only image and intrinsics are used."""

    def __init__(self, goal: GoalObservation) -> None:
        self._camera = goal.camera
        self._sift = cv2.SIFT.create(nfeatures=_FEATURES)
        self._goal = _describe(self._sift, goal.image)
        self._failed = 0

    def decide(self, observation: Observation) -> Decision:
        """One step of the classical law; without enough points the camera stays."""
        pixels, partners = self._correspondences(observation.image)
        z_m, known = _depth_at(observation, pixels)
        pixels, partners, z_m = pixels[known], partners[known], z_m[known]
        xy, xy_goal = self._camera.normalise(pixels), self._camera.normalise(partners)
        P = homogeneous(xy) * z_m[:, None]
        found = perspective_pose(P, xy_goal, REPROJECTION_PX / self._camera.fx)
        if found is None:
            self._failed += 1
            lost = "too few points match" if self._failed >= _FAILURES else ""
            return Decision(np.eye(4), float("inf"), lost=lost)
        self._failed, keep = 0, found[1]
        weight = np.ones(len(keep))
        L = interaction_matrix(xy[keep], z_m[keep])
        equations = normal_equations(L, xy[keep] - xy_goal[keep], weight)
        lengths = np.linalg.norm(pixels[keep] - partners[keep], axis=1)
        error_px = weighted_median(lengths, weight)
        motion = _GAIN * equations.solve(damping=0.0)
        return Decision(se3_exp(motion), error_px, done=error_px < _ERROR_AT_GOAL_PX)

    def _correspondences(self, image: ImageArray) -> tuple[FloatArray, FloatArray]:
        """Points (N, 2) px here and in the goal image."""
        points, descriptors = _describe(self._sift, image)
        goal_points, goal_descriptors = self._goal
        if min(len(points), len(goal_points)) < LEAST_POINTS:
            return np.zeros((0, 2)), np.zeros((0, 2))
        matches = cv2.BFMatcher(cv2.NORM_L2).knnMatch(descriptors, goal_descriptors, k=2)
        good = [a for a, b in matches if a.distance < _RATIO * b.distance]
        return points[[m.queryIdx for m in good]], goal_points[[m.trainIdx for m in good]]


def _describe(sift: cv2.SIFT, image: ImageArray) -> tuple[FloatArray, Float32Array]:
    """Points (N, 2) px in our pixel convention, and their descriptors (N, 128)."""
    points, descriptors = sift.detectAndCompute(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), None)
    if descriptors is None:
        return np.zeros((0, 2)), np.zeros((0, 128), np.float32)
    pixels = np.array([p.pt for p in points]).reshape(-1, 2) + 0.5
    return pixels, np.asarray(descriptors, dtype=np.float32)


def _depth_at(observation: Observation, pixels: FloatArray) -> tuple[FloatArray, BoolArray]:
    """True depth (N,) m at pixels, and where it is known."""
    height, width = observation.depth.z_m.shape
    i = np.clip(pixels[:, 0].astype(np.intp), 0, width - 1)
    j = np.clip(pixels[:, 1].astype(np.intp), 0, height - 1)
    return observation.depth.z_m[j, i].astype(np.float64), observation.depth.validity[j, i] > 0
