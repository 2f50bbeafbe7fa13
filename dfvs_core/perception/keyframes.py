"""Keyframe selection by baseline and time.

A frame becomes one where the view has changed since the last keyframe, and at the latest after
``LONGEST_INTERVAL_NS``. Depth from motion and previews of other goals use them.
"""

from dataclasses import dataclass

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import pose_error
from dfvs_core.matching.matcher import ImageFeatures
from dfvs_core.servo.exchange import ServoInputs, ServoState

LEAST_INTERVAL_NS, LONGEST_INTERVAL_NS = 100_000_000, 250_000_000
HORIZON_NS = 5_000_000_000
"""Age at which a keyframe is dropped; with the least interval it bounds their number."""
MOST_KEYFRAMES = HORIZON_NS // LEAST_INTERVAL_NS + 1

_LEAST_PARALLAX, _WANTED_PARALLAX = 0.01, 0.04
"""Baseline over depth that changes the view, and at which a correspondence of 0.5 px gives depth
to a few per cent."""
_LEAST_TURN_RAD, _MOST_TURN_RAD = 0.02, 0.35
"""Rotation that changes the view, and beyond which no depth is triangulated."""


@dataclass(frozen=True, slots=True)
class Keyframe:
    """A frame, ready to be matched, and what a preview of another goal needs of it.

    ``T_world_camera`` (4, 4) is where its camera was, m. ``inputs`` are the servo step's without
    any flow. ``state`` is the memory after the frame, without what concerns the goal.
    """

    features: ImageFeatures
    T_world_camera: FloatArray
    inputs: ServoInputs
    state: ServoState

    @property
    def t_capture_ns(self) -> int:
        """When the frame was taken."""
        return self.inputs.t_capture_ns


class Keyframes:
    """The keyframes of the last ``HORIZON_NS``, at most ``MOST_KEYFRAMES``."""

    def __init__(self) -> None:
        self._frames: list[Keyframe] = []

    def __len__(self) -> int:
        return len(self._frames)

    def add(self, frame: Keyframe, depth_m: float) -> None:
        """Take in a frame, of a scene of this median depth, m; most do not become a keyframe."""
        t_ns = frame.t_capture_ns
        self._frames = [k for k in self._frames if t_ns - k.t_capture_ns <= HORIZON_NS]
        if not self._frames or self._is_due(frame, depth_m):
            self._frames.append(frame)

    def _is_due(self, frame: Keyframe, depth_m: float) -> bool:
        """Whether a frame becomes a keyframe after the newest one."""
        newest = self._frames[-1]
        since_ns = frame.t_capture_ns - newest.t_capture_ns
        if not LEAST_INTERVAL_NS <= since_ns < LONGEST_INTERVAL_NS:
            return since_ns >= LONGEST_INTERVAL_NS
        baseline_m, angle_rad = pose_error(newest.T_world_camera, frame.T_world_camera)
        return baseline_m >= _LEAST_PARALLAX * depth_m or angle_rad >= _LEAST_TURN_RAD

    def find(self, t_capture_ns: int | None = None) -> Keyframe | None:
        """Keyframe of a capture time, or the newest; None where it is not kept."""
        times = [k.t_capture_ns for k in self._frames]
        if t_capture_ns is None:
            return self._frames[-1] if times else None
        return self._frames[times.index(t_capture_ns)] if t_capture_ns in times else None

    def for_depth(
        self, T_world_camera: FloatArray, depth_m: float, least_m: float = 0.0
    ) -> Keyframe | None:
        """Keyframe to triangulate the depth of a frame against, from its pose (4, 4), m.

        The newest whose baseline suffices at a median depth, m, and is ``least_m`` or more; else
        the one with the longest. None if all are too near or too turned.
        """
        wanted_m = max(_WANTED_PARALLAX * depth_m, least_m)
        best, best_baseline_m = None, _LEAST_PARALLAX * depth_m
        for frame in reversed(self._frames):
            baseline_m, angle_rad = pose_error(frame.T_world_camera, T_world_camera)
            if angle_rad > _MOST_TURN_RAD:
                continue
            if baseline_m >= wanted_m:
                return frame
            if baseline_m > best_baseline_m:
                best, best_baseline_m = frame, baseline_m
        return best
