"""Perception on recorded odometry of PX4, with a camera that moves along the recorded truth."""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from box_room import BoxRoom, PosedMatcher

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import make_pose, rotation_from_euler
from dfvs_core.messages.frame import Frame
from dfvs_core.messages.goal import Goal, GoalSidecar, Mount
from dfvs_core.messages.link import VehicleState
from dfvs_core.perception.pipeline import Pipeline
from dfvs_core.perception.vehicle_history import VehicleHistory
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.exchange import ServoResult
from dfvs_core.servo.task import ServoTask

DATA = Path(__file__).parent / "data"
CAMERA = CameraModel.from_horizontal_fov(192, 144, 1.3)
NOISE_PX = 0.3
SAMPLES_PER_FRAME = 5
"""Of about 42 samples a second."""


def _noise(rng):
    """White error of the flow, px, that is alike over a few pixels, as a network's is."""
    cells = rng.normal(0.0, NOISE_PX, (CAMERA.height // 8, CAMERA.width // 8, 2))
    return cells.repeat(8, axis=0).repeat(8, axis=1)


@dataclass(frozen=True)
class Excerpt:
    """Time (n,) s, and position, velocity (n, 3) NED and attitude (n, 3) rad, told and true."""

    t_s: np.ndarray
    told: tuple[np.ndarray, np.ndarray, np.ndarray]
    true: tuple[np.ndarray, np.ndarray, np.ndarray]


@cache
def excerpt(name):
    with np.load(DATA / f"px4_{name}.npz") as data:
        told = data["position_ned_m"], data["velocity_ned_m_s"], euler(data["q_wxyz"])
        true = (
            data["true_position_ned_m"],
            data["true_velocity_ned_m_s"],
            euler(data["true_q_wxyz"]),
        )
        return Excerpt(data["t_us"] * 1e-6, told, true)


def euler(q_wxyz):
    """Roll, pitch, yaw (n, 3) rad of quaternions (n, 4)."""
    w, x, y, z = q_wxyz.astype(float).T
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    return np.stack([roll, pitch, np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))], axis=1)


@dataclass(frozen=True)
class Seen:
    """One frame: time s, what perception says, true distance to the goal and true depth, m."""

    t_s: float
    result: ServoResult
    distance_m: float
    depth_m: float


def fly(name, odometry="told", looks_yaw_rad=0.0, since_s=0.0, until_s=1e9):
    """Frames of an excerpt, with a goal 1 m ahead of where it begins.

    ``odometry`` is ``told`` or ``true``. ``looks_yaw_rad`` is where the camera truly looks, about
    the vehicle's vertical; the settings say ahead.
    """
    return _fly(name, odometry, looks_yaw_rad, since_s, until_s)


@cache
def _fly(name, odometry, looks_yaw_rad, since_s, until_s):
    flight, room, said = excerpt(name), BoxRoom(CAMERA), Mount()
    truly = replace(said, yaw_rad=looks_yaw_rad)
    position, _, attitude = flight.true
    chosen = np.flatnonzero((flight.t_s >= since_s) & (flight.t_s < until_s))
    centre = position[chosen].mean(axis=0)
    rng = np.random.default_rng(0)
    matcher = PosedMatcher(room, lambda: _noise(rng))

    first = chosen[0]
    T_goal = (
        make_pose(rotation_from_euler(0.0, 0.0, attitude[first, 2]), position[first] - centre)
        @ truly.T_body_camera()
    )
    T_goal[:3, 3] += T_goal[:3, 2]
    matcher.T_world_camera = T_goal
    blank = np.full((CAMERA.height, CAMERA.width, 3), 128, np.uint8)
    sidecar = GoalSidecar(CAMERA)
    task = ServoTask(ServoConfig(), CAMERA, sidecar, said)
    now_ns = 0
    pipeline = Pipeline(task, matcher, Goal(blank, sidecar), lambda: now_ns)
    history = VehicleHistory()
    odometry_position, velocity, odometry_attitude = getattr(flight, odometry)
    frames = []
    for k in chosen:
        now_ns = round(flight.t_s[k] * 1e9) + 1
        angles = map(float, odometry_attitude[k])
        state = tuple(map(float, velocity[k])), tuple(map(float, odometry_position[k]))
        history.add(VehicleState(now_ns, *angles, *state))
        motion = history.at(now_ns)
        if motion is None or (k - first) % SAMPLES_PER_FRAME:
            continue
        T_body = make_pose(rotation_from_euler(*map(float, attitude[k])), position[k] - centre)
        matcher.T_world_camera = T = T_body @ truly.T_body_camera()
        outcome = pipeline.process_frame(Frame(blank, now_ns, int(k)), motion, engaged=False)
        pipeline.work_between_frames()
        visible = outcome.flow.confidence > 0.5
        depth_m = float(np.median(room.depth(T)[visible])) if visible.any() else 0.0
        distance_m = float(np.linalg.norm(T[:3, 3] - T_goal[:3, 3]))
        frames.append(Seen(flight.t_s[k], outcome.result, distance_m, depth_m))
    return frames
