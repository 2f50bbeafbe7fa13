"""Perception of a vehicle in a box-shaped room whose odometry errs, in simulated time."""

from dataclasses import dataclass

import cv2
import numpy as np
from box_room import BoxRoom, PosedMatcher

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import make_pose, rotation_from_euler
from dfvs_core.messages.frame import Frame
from dfvs_core.messages.goal import Goal, GoalSidecar, Mount
from dfvs_core.messages.link import VehicleState
from dfvs_core.perception.frame_result import FrameResult
from dfvs_core.perception.pipeline import Pipeline
from dfvs_core.perception.vehicle_history import VehicleHistory
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.task import ServoTask

CAMERA = CameraModel.from_horizontal_fov(160, 120, np.radians(75))
ROOM = BoxRoom(CAMERA)
STATE_S = 0.02
STATES_A_FRAME = 3
RESPONSE_S = 0.3
GRAVITY_M_S2 = 9.81
_START_NS = 10**9


def _noise(rng):
    """Error of the flow, px: 0.3, alike over 16 px."""
    return cv2.resize(rng.normal(0.0, 0.4, (9, 11, 2)).astype(np.float32), (160, 120))


@dataclass(frozen=True)
class Look:
    """One frame: time, true distance to the goal, and what perception makes of it."""

    t_s: float
    distance_m: float
    outcome: FrameResult

    @property
    def ratio(self):
        """Estimated over true distance."""
        return self.outcome.result.error_m / self.distance_m


class BoxFlight:
    """A level-headed vehicle that tilts as it accelerates, before a goal at the room's centre.

    Parameters
    ----------
    start_m : (3,)
        NED, off the goal.
    mounted : Mount
        How the camera sits. The settings say that it looks ahead.
    seed : int
        Of the flow's errors.
    depth : str
        Choice of ``servo.depth``.
    network : DepthEstimator, optional
        For ``network`` and ``fused``.
    room : BoxRoom
        Around it.
    """

    def __init__(self, start_m, mounted=None, seed=0, depth="motion", network=None, room=ROOM):
        self._T_body_camera = (mounted or Mount()).T_body_camera()
        rng = np.random.default_rng(seed)
        self.matcher = PosedMatcher(room, lambda: _noise(rng))
        self.matcher.T_world_camera = make_pose(np.eye(3), np.zeros(3)) @ self._T_body_camera
        image = np.random.default_rng(0).integers(0, 255, (120, 160, 3)).astype(np.uint8)
        sidecar = GoalSidecar(CAMERA)
        task = ServoTask(ServoConfig(depth=depth), CAMERA, sidecar, Mount())
        self._now_ns = _START_NS
        self._image = image
        self._task, self._goal = task, Goal(image, sidecar)
        self._pipeline = Pipeline(task, self.matcher, self._goal, lambda: self._now_ns, network)
        self._history = VehicleHistory()
        self.position_m = np.array(start_m, np.float64)
        self._estimate_m = self.position_m.copy()
        self.velocity_m_s = np.zeros(3)
        self.goal_m = np.zeros(3)
        self.looks: list[Look] = []

    @property
    def state(self):
        """Memory of the servo step."""
        return self._pipeline._state

    def go_on(self, goal_m=(0.0, 0.0, 0.0)):
        """Go on to another goal, NED off the room's centre."""
        self.goal_m = np.array(goal_m)
        here = self.matcher.T_world_camera
        self.matcher.T_world_camera = make_pose(np.eye(3), self.goal_m) @ Mount().T_body_camera()
        self._pipeline.set_goal(self._task, self._pipeline.prepare(self._goal))
        self.matcher.T_world_camera = here

    def step(self, velocity, error, rate_error=None):
        """Fly for 20 ms; the velocity estimate errs by ``error`` (3,) NED, m/s.

        The rate of the position estimate errs by ``rate_error``, or by the same.
        """
        wanted = self.velocity_m_s + (np.array(velocity) - self.velocity_m_s) * STATE_S / RESPONSE_S
        acceleration = (wanted - self.velocity_m_s) / STATE_S
        self.velocity_m_s = wanted
        self.position_m += STATE_S * self.velocity_m_s
        told = self.velocity_m_s + np.array(error)
        rate = told if rate_error is None else self.velocity_m_s + np.array(rate_error)
        self._estimate_m += STATE_S * rate
        self._now_ns += round(STATE_S * 1e9)
        roll, pitch = acceleration[1] / GRAVITY_M_S2, -acceleration[0] / GRAVITY_M_S2
        self._history.add(
            VehicleState(self._now_ns, roll, pitch, 0.0, tuple(told), tuple(self._estimate_m))
        )
        count = (self._now_ns - _START_NS) // round(STATE_S * 1e9)
        if count % STATES_A_FRAME == 0 and count > STATES_A_FRAME:
            self._look(rotation_from_euler(roll, pitch, 0.0))

    def _look(self, R_world_body):
        self.matcher.T_world_camera = make_pose(R_world_body, self.position_m)
        self.matcher.T_world_camera = self.matcher.T_world_camera @ self._T_body_camera
        frame = Frame(self._image, self._now_ns, len(self.looks))
        outcome = self._pipeline.process_frame(frame, self._history.at(self._now_ns), engaged=True)
        self._pipeline.work_between_frames()
        t_s = (self._now_ns - _START_NS) * 1e-9
        self.looks.append(Look(t_s, float(np.linalg.norm(self.position_m - self.goal_m)), outcome))
