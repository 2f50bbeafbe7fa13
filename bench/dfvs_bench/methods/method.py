"""What the benchmark asks of a servoing method, and what it gives it to see."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.depth.network import DepthEstimator
from dfvs_core.geometry.arrays import FloatArray, ImageArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.matching.matcher import Matcher
from dfvs_core.servo.config import BY_NETWORK, DepthChoice
from dfvs_models.catalog import load_depth, load_pose
from dfvs_models.pose import PoseNetwork

FRAME_PERIOD_S = 0.1
"""Time between two frames of methods that reckon in seconds: gain 1/s is 0.1 a frame."""


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """What a method may use in one iteration."""

    index: int
    """Number of the iteration, from 0."""
    image: ImageArray
    """(H, W, 3) uint8: RGB."""
    depth: DepthMap
    """True depth (H, W); only methods that say so look at it."""
    T_world_camera: FloatArray
    """(4, 4): where the camera is, in a world that knows nothing of the goal: odometry."""


@dataclass(frozen=True, slots=True, eq=False)
class GoalObservation:
    """The goal image (H, W, 3) RGB, its true depth (H, W), and the camera of both views."""

    camera: CameraModel
    image: ImageArray
    depth: DepthMap


def median_depth_m(depth: DepthMap) -> float | None:
    """Median over the valid pixels; None where none is."""
    known = depth.z_m[depth.validity > 0]
    return float(np.median(known)) if known.size else None


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """What a method does with what it saw."""

    T_current_next: FloatArray
    """(4, 4): motion of the camera until the next frame, in the current optical frame, m."""
    error: float
    """The method's own error: median flow in px, or grey levels."""
    done: bool = False
    """The method's own stop rule is satisfied."""
    lost: str = ""
    """Why the method gives up; empty while it does not."""


class ServoMethod(Protocol):
    """Leads a free camera to the goal, frame after frame."""

    def decide(self, observation: Observation) -> Decision:
        """Decide on one frame."""
        ...


@dataclass(frozen=True, slots=True)
class Networks:
    """Networks beside the matcher, of those methods that need one."""

    depth: DepthEstimator | None = None
    pose: PoseNetwork | None = None


@dataclass(frozen=True, slots=True)
class MethodKind:
    """A method that the benchmark knows by name."""

    make: Callable[[GoalObservation, Matcher, Networks], ServoMethod]
    """Builds the method for one goal."""
    summary: str
    iterations: int
    """How many frames it is given, by its authors' setting."""
    depth: DepthChoice = "motion"
    """Choice of ``servo.depth`` that a depth network is loaded for, if it needs one."""
    pose: str = ""
    """Name of the network that regresses poses which it needs, if any."""

    @property
    def network(self) -> str:
        """Bundle that it needs beside the matcher: ``"depth"``, ``pose``, or none."""
        return self.pose or ("depth" if self.depth in BY_NETWORK else "")

    def load(self, bundle: str | None) -> Networks:
        """Load the network that it needs from a bundle.

        Raises
        ------
        ModelError
            If there is no such bundle, or it cannot be used.
        """
        if bundle is None:
            return Networks()
        if self.pose:
            return Networks(pose=load_pose(bundle, threads=1))
        return Networks(depth=load_depth(self.depth, bundle, threads=1))
