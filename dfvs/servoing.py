"""Servoing to a goal image, frame by frame."""

import operator
from dataclasses import dataclass, fields, replace

import numpy as np

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import FloatArray, ImageArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import invert_pose
from dfvs_core.matching.matcher import Matcher
from dfvs_core.messages.frame import Frame
from dfvs_core.messages.goal import Goal, GoalSidecar, Mount
from dfvs_core.messages.schema import dump, parse
from dfvs_core.perception.pipeline import Pipeline
from dfvs_core.perception.vehicle_history import Motion
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.exchange import ServoResult
from dfvs_core.servo.task import ServoTask

_AT_REST = Motion.at_rest(0.0, 0.0)


@dataclass(frozen=True, slots=True)
class _LastStep:
    """Motion at the last frame, the velocity (d,) that followed, and whether it is by odometry."""

    motion: Motion
    velocity: FloatArray
    has_odometry: bool


class Servo:
    """Velocities that lead a camera to a goal image.

    It keeps what was learnt from earlier frames: one object serves one flight to one goal. It moves
    nothing, and none of the gate's limits and watchdogs hold for what it returns.

    Parameters
    ----------
    matcher : Matcher
        Of :func:`load_matcher`.
    goal : (H, W, 3) uint8 or Goal
        Goal image, RGB, of the frames' size. A :class:`Goal` also tells by which camera, mounting
        and attitude it was taken; an image alone counts as taken level, by the camera that flies.
    camera : CameraModel
        Intrinsics of the frames.
    mount : Mount, optional
        How the camera sits on a vehicle that stays level, such as a multirotor. Without it the
        camera is free to move in all six degrees of freedom.
    config : ServoConfig, optional
        The defaults are those of the service, for a vehicle that follows a velocity 0.65 s late. A
        camera that follows at once needs ``response_s=0.0, yaw_response_s=0.0``.

    Raises
    ------
    ImageError
        If the goal image is not (H, W, 3) uint8 or not of its camera's size.
    ConfigError
        If a value of ``config`` is out of its range or none of its choices, or its ``depth`` is
        not available here.

    Examples
    --------
    >>> import cv2, numpy as np
    >>> import dfvs
    >>> noise = np.random.default_rng(0).integers(0, 256, (240, 320, 3), np.uint8)
    >>> goal = cv2.GaussianBlur(noise, (0, 0), 2.0)
    >>> camera = dfvs.CameraModel.from_horizontal_fov(320, 240, 1.2)
    >>> servo = dfvs.Servo(dfvs.load_matcher("classical"), goal, camera)
    >>> result = servo.step(np.roll(goal, 12, axis=1), t_capture_ns=0)
    >>> result.status, result.velocity.shape, bool(result.velocity[0] > 0.0)
    (<Status.OK: 'ok'>, (6,), True)
    """

    def __init__(
        self,
        matcher: Matcher,
        goal: ImageArray | Goal,
        camera: CameraModel,
        mount: Mount | None = None,
        config: ServoConfig | None = None,
    ) -> None:
        if not isinstance(goal, Goal):
            goal = Goal(goal, GoalSidecar(camera, mount=mount or Mount()))
        goal.sidecar.camera.check_size(goal.image, "the goal image")
        config = parse(ServoConfig, dump(config or ServoConfig()), "servo")
        self._task = ServoTask(config, camera, goal.sidecar, mount)
        if self._task.config.depth == "given":
            raise ConfigError("servo.depth = 'given' without depth", "'motion' or 'constant'")
        self._pipeline = Pipeline(self._task, matcher, goal, lambda: self._now_ns)
        self._now_ns = 0
        self._seq = 0
        self._last: _LastStep | None = None

    def step(
        self,
        image: ImageArray,
        t_capture_ns: int,
        odometry: Motion | None = None,
        *,
        age_ns: int = 0,
        engaged: bool = True,
    ) -> ServoResult:
        """Velocity by one frame.

        Parameters
        ----------
        image : (H, W, 3) uint8
            RGB frame.
        t_capture_ns : int
            When it was taken, monotonic ns.
        odometry : Motion, optional
            State of the body (FRD) then, in a world with z down; of a free camera, whose body is
            its optical frame, in any fixed world. See :meth:`Motion.from_pose`. Without it the
            camera counts as moved by the velocities of the last steps, and a vehicle as level.
        age_ns : int
            Time since the frame was taken; a vehicle's motion in between is predicted.
        engaged : bool
            Whether the vehicle follows. Only then the error has to fall.

        Returns
        -------
        ServoResult
            ``velocity`` of a free camera is its twist (6,) in the optical frame (x right, y down, z
            forward), m/s and rad/s; with a mounting it is (4,): forward, right and down of the
            level body in m/s, and the yaw rate in rad/s. It is zero unless ``status`` is
            ``Status.OK``. ``reached``: the goal is reached.

        Raises
        ------
        ImageError
            If the frame is not (H, W, 3) uint8 or not of its camera's size.
        ConfigError
            If a time is not an integer, the frame is not newer than the last, only some of the
            frames have odometry, or it is not finite. Such a frame leaves no trace: the next one
            may follow.
        """
        self._task.camera.check_size(image, "the frame")
        t_capture_ns = _whole_ns("t_capture_ns", t_capture_ns)
        age_ns = _whole_ns("age_ns", age_ns)
        last = self._last
        if last is not None and t_capture_ns <= last.motion.t_ns:
            raise ConfigError(
                f"a frame of {t_capture_ns} ns after {last.motion.t_ns} ns", "a newer one"
            )
        if last is not None and last.has_odometry != (odometry is not None):
            raise ConfigError("only some of the frames have odometry", "all of them, or none")
        if odometry is not None:
            _check_finite(odometry)
        motion = odometry
        if motion is None:
            motion = _AT_REST if last is None else self._dead_reckoned(last, t_capture_ns)
        motion = replace(motion, t_ns=t_capture_ns)
        self._now_ns = t_capture_ns + age_ns
        self._seq += 1
        frame = Frame(image, t_capture_ns, self._seq)
        result = self._pipeline.process_frame(frame, motion, engaged).result
        self._pipeline.work_between_frames()
        self._last = _LastStep(motion, result.velocity, odometry is not None)
        return result

    def _dead_reckoned(self, last: _LastStep, t_ns: int) -> Motion:
        """Motion of a body that flew the last velocity."""
        T_body_camera = self._task.T_body_camera
        dt_s = (t_ns - last.motion.t_ns) * 1e-9
        moved = T_body_camera @ self._task.basis.exp(dt_s * last.velocity)
        T_world_body = last.motion.T_world_body() @ moved @ invert_pose(T_body_camera)
        velocity_m_s = T_world_body[:3, :3] @ last.velocity[:3]
        return Motion.from_pose(T_world_body, velocity_m_s, float(last.velocity[3]))


def _whole_ns(name: str, time_ns: int) -> int:
    """Time of a caller, who may have passed seconds."""
    try:
        return operator.index(time_ns)
    except TypeError as error:
        raise ConfigError(
            f"{name} is {time_ns!r}", "an integer", "pass nanoseconds: round(seconds * 1e9)"
        ) from error


def _check_finite(motion: Motion) -> None:
    """Refuse odometry with a number that is none."""
    for field in fields(motion):
        value = getattr(motion, field.name)
        if not np.isfinite(value).all():
            raise ConfigError(f"{field.name} of the odometry is {value}", "finite numbers")
