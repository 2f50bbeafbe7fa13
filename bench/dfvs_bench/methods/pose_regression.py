"""Position-based servoing on a pose that a network regresses from two images.

The law of Saxena et al. (ICRA 2017) and of Bateux et al. (ICRA 2018), which differ in the network.
The network is asked for both orders of the images, and the mean of both motions is taken: so the
goal itself is where it stops, which no network's bias can shift. The authors ask once.
"""

import numpy as np

from dfvs_bench.methods.method import Decision, GoalObservation, Observation, median_depth_m
from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.errors import ModelError
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import se3_exp, se3_log
from dfvs_models.pose import PoseNetwork

ITERATIONS = 300
_GAIN = 0.1
_AT_GOAL_M, _AT_GOAL_RAD = 0.002, 0.001
_AT_GOAL_FRAMES = 10
"""Frames in a row that have to say so."""
_LONGEST_STEP_M = 0.5


class PoseRegressionMethod:
    """Goes a tenth of the way to where a network says that the goal is.

    The true median depth of the second image scales a translation that is in depths; else depth is
    not looked at.

    Raises
    ------
    ModelError
        If there is no network.
    """

    def __init__(self, goal: GoalObservation, network: PoseNetwork | None) -> None:
        if network is None:
            raise ModelError("no network that regresses poses", "a bundle of the kind 'pose'")
        self._network, self._camera = network, goal.camera
        self._goal = network.fit(goal.image, goal.camera)
        self._of_goal = self._to_m(goal.depth)
        self._at_goal = 0

    def decide(self, observation: Observation) -> Decision:
        """A tenth of the way; done where the goal is said to be here for some frames."""
        motion = self._motion(observation)
        distance_m, angle_rad = (float(np.linalg.norm(part)) for part in (motion[:3], motion[3:]))
        is_here = distance_m < _AT_GOAL_M and angle_rad < _AT_GOAL_RAD
        self._at_goal = self._at_goal + 1 if is_here else 0
        step = _GAIN * motion
        step *= min(1.0, _LONGEST_STEP_M / max(_GAIN * distance_m, 1e-9))
        return Decision(se3_exp(step), distance_m, self._at_goal >= _AT_GOAL_FRAMES)

    def _to_m(self, depth: DepthMap) -> FloatArray:
        """Factors (6,) of a motion to an image of this depth."""
        scale = (median_depth_m(depth) or 1.0) if self._network.unit == "depth" else 1.0
        return np.array([scale] * 3 + [1.0] * 3)

    def _motion(self, observation: Observation) -> FloatArray:
        """Motion (6,) to the goal in one unit of time, m and rad."""
        current = self._network.fit(observation.image, self._camera)
        there = se3_log(self._network.relative_pose(current, self._goal)) * self._of_goal
        back = se3_log(self._network.relative_pose(self._goal, current))
        back = back * self._to_m(observation.depth)
        return np.asarray(0.5 * (there - back), np.float64)
