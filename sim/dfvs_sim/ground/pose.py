"""The vehicle's pose at a time of this machine's clock, from its telemetry.

The vehicle stamps with its own clock (``time_boot_ms``); ``ClockMap`` takes it to this machine's.
A simulated vehicle sends its true motion (HIL_STATE_QUATERNION), which is preferred where it comes:
a camera has to be where the vehicle is and not where the vehicle's estimate puts it.
"""

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pymavlink.dialects.v20 import development as mavlink

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import (
    euler_from_rotation,
    make_pose,
    rotation_from_euler,
    rotation_from_quaternion,
)
from dfvs_sim.ground.clock import ClockMap, SlowClockNotice
from dfvs_sim.ground.interpolation import (
    AttitudeSample,
    PositionSample,
    append,
    attitude_at,
    position_at,
)
from dfvs_sim.ground.link import ACCEPTED, GroundLink, Message
from dfvs_sim.ground.systems import LinkError
from dfvs_sim.ground.truth import LocalOrigin, TruthFilter
from dfvs_sim.viewpoints.poses import CameraPoses

_KEPT = 128
_REACH_NS = 200_000_000
"""How far beyond the newest sample a pose may be extrapolated."""
_RATE_HZ = 50.0
_TRUTH, _ORIGIN, _PLACE, _ATTITUDE = (
    "HIL_STATE_QUATERNION",
    "GPS_GLOBAL_ORIGIN",
    "LOCAL_POSITION_NED",
    "ATTITUDE_QUATERNION",
)
_TRUTH_S = 3.0
"""How long the truth, and then the origin, are waited for."""
_SILENCE_NS = 1_000_000_000
"""Silence of the truth after which it is asked for again: the vehicle was started anew."""
_BURST_NS = 2_000_000
"""Messages that arrive within this time were read at once, and are late alike."""
_STALLED_NS = 25_000_000
"""Pause of the stamped messages, in vehicle time, after which the thread has been held up."""


@dataclass(frozen=True, slots=True)
class VehiclePose:
    """Pose in the vehicle's local frame (NED); ``t_ns`` is monotonic time of this machine."""

    t_ns: int
    position_m: tuple[float, float, float]
    roll_rad: float
    pitch_rad: float
    yaw_rad: float

    def T_local_body(self) -> FloatArray:
        """Pose (4, 4) of the body (FRD) in the local frame (NED)."""
        R = rotation_from_euler(self.roll_rad, self.pitch_rad, self.yaw_rad)
        return make_pose(R, np.array(self.position_m))


class PoseTracker:
    """Follows the vehicle's telemetry and tells its pose at a time.

    The pose is the true one where the vehicle sends HIL_STATE_QUATERNION, else that of the
    estimate: LOCAL_POSITION_NED and ATTITUDE_QUATERNION. ``start`` asks for all three at 50 Hz over
    the shared link. ``log`` takes the line that says that the vehicle's clock is slower than real
    time.
    """

    def __init__(self, link: GroundLink, log: Callable[[str], None] = lambda _: None) -> None:
        self._link = link
        self._lock = threading.Lock()
        self._clock = ClockMap()
        self._slow = SlowClockNotice(log)
        self._delay_ns = 0
        self._stamped_ns: int | None = None
        self._requested_ns = 0
        self._truth: TruthFilter | None = None
        self._places: deque[PositionSample] = deque(maxlen=_KEPT)
        self._turns: deque[AttitudeSample] = deque(maxlen=_KEPT)
        link.subscribe([_PLACE, _ATTITUDE, _TRUTH], self.on_message)

    def start(self, timeout_s: float = 10.0) -> None:
        """Ask for the streams and wait for the first pose.

        Raises
        ------
        LinkError
            If the vehicle does not answer or sends no pose.
        """
        self._link.wait_for_vehicle(timeout_s)
        for name in (_PLACE, _ATTITUDE):
            since_ns = time.monotonic_ns()
            self._link.request_stream(name, _RATE_HZ)
            self._await(name, timeout_s, since_ns)
        if self._link.request_stream(_TRUTH, _RATE_HZ) != ACCEPTED:
            return
        truth = self._link.wait_for(_TRUTH, _TRUTH_S)
        if truth is None:
            return
        self.follow_truth(self._local_origin(truth))
        while self.newest_ns() is None:
            self._await(_TRUTH, timeout_s, time.monotonic_ns())

    def require_truth(self) -> None:
        """Refuse a vehicle that is not known to be a simulated one.

        Raises
        ------
        LinkError
            If it sends no true pose.
        """
        if self._truth is None:
            raise LinkError(
                f"the vehicle sends no true pose ({_TRUTH}), and may be a real one",
                "a simulated vehicle, since it would be armed and flown",
            )

    def follow_truth(self, origin: LocalOrigin) -> None:
        """Take the poses from HIL_STATE_QUATERNION from now on, in the frame of that origin."""
        with self._lock:
            self._truth = TruthFilter(origin)
            self._requested_ns = self._stamped_ns or 0
            self._places.clear()
            self._turns.clear()

    def on_message(self, message: Message, arrival_ns: int) -> None:
        """Take one message of the three types."""
        with self._lock:
            if message.get_type() == _TRUTH:
                self._on_truth(message, arrival_ns)
            else:
                self._on_stamped(message, arrival_ns)
            rate = self._clock.simulation_rate
        self._slow.update(rate, arrival_ns)

    def _on_stamped(self, message: Message, arrival_ns: int) -> None:
        """Take a message of the estimate, which bears a stamp."""
        stamp_ns = message.time_boot_ms * 1_000_000
        if self._clock.update(stamp_ns, arrival_ns):
            self._places.clear()
            self._turns.clear()
        self._delay_ns = arrival_ns - stamp_ns - self._clock.offset_ns
        self._stamped_ns = arrival_ns
        if self._truth is not None:
            self._request_again(arrival_ns)
        elif message.get_type() == _PLACE:
            position = (message.x, message.y, message.z)
            velocity = (message.vx, message.vy, message.vz)
            append(self._places, PositionSample(stamp_ns, position, velocity))
        else:
            q = (message.q1, message.q2, message.q3, message.q4)
            rates = (message.rollspeed, message.pitchspeed, message.yawspeed)
            append(self._turns, AttitudeSample(stamp_ns, q, rates))

    def _on_truth(self, message: Message, arrival_ns: int) -> None:
        """Take a true state, which PX4 v1.17 sends without a stamp."""
        if self._truth is None or self._stamped_ns is None:
            return
        since_stamped_ns = arrival_ns - self._stamped_ns
        clock = self._clock
        if clock.vehicle_ns(arrival_ns) - clock.vehicle_ns(self._stamped_ns) > _STALLED_NS:
            return  # the first of a backlog: nobody knows how late it is
        late_ns = self._delay_ns if since_stamped_ns < _BURST_NS else 0
        stamp_ns = clock.vehicle_ns(arrival_ns - late_ns)
        if self._places and stamp_ns <= self._places[-1].stamp_ns:
            return
        self._places.append(PositionSample(stamp_ns, *self._truth.update(stamp_ns, message)))
        w, x, y, z = message.attitude_quaternion
        rates = (message.rollspeed, message.pitchspeed, message.yawspeed)
        self._turns.append(AttitudeSample(stamp_ns, (w, x, y, z), rates))

    def _request_again(self, now_ns: int) -> None:
        """Ask for the truth anew where it has ended, without waiting for an answer."""
        if self._places:
            truth_ns = self._clock.local_ns(self._places[-1].stamp_ns)
            self._requested_ns = max(self._requested_ns, truth_ns)
        if now_ns - self._requested_ns < _SILENCE_NS:
            return
        self._requested_ns = now_ns
        interval_us = 1e6 / _RATE_HZ
        number = mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION
        command = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        self._link.send(
            mavlink.MAVLink_command_long_message(
                *(self._link.target, 1, command, 0, number, interval_us, 0, 0, 0, 0, 0)
            )
        )

    def _local_origin(self, truth: Message) -> LocalOrigin:
        """Origin of the local frame: as the vehicle tells it, or by the estimated position."""
        number = mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN
        self._link.command(mavlink.MAV_CMD_REQUEST_MESSAGE, number)
        origin = self._link.wait_for(_ORIGIN, _TRUTH_S)
        if origin is not None:
            return LocalOrigin(origin.latitude, origin.longitude, origin.altitude)
        place = self._await(_PLACE, _TRUTH_S, 0)
        return LocalOrigin.placing(truth, (place.x, place.y, place.z))

    def _await(self, name: str, timeout_s: float, since_ns: int) -> Message:
        message = self._link.wait_for(name, timeout_s, since_ns=since_ns)
        if message is None:
            raise LinkError(
                f"the vehicle sends no {name}", "its pose", "is its position estimate valid?"
            )
        return message

    def newest_ns(self) -> int | None:
        """Local time up to which both position and attitude are known; None before the first."""
        with self._lock:
            if not self._places or not self._turns:
                return None
            stamp = min(self._places[-1].stamp_ns, self._turns[-1].stamp_ns)
            return self._clock.local_ns(stamp)

    def camera_poses(self, T_scene_local: FloatArray, T_body_camera: FloatArray) -> CameraPoses:
        """Poses of a camera on the vehicle, whose local frame lies so in the scene."""

        def T_scene_camera(t_ns: int) -> FloatArray | None:
            pose = self.pose_at(t_ns)
            return None if pose is None else T_scene_local @ pose.T_local_body() @ T_body_camera

        return T_scene_camera

    def pose_at(self, t_ns: int) -> VehiclePose | None:
        """Pose at a monotonic time: interpolated, or extrapolated a little.

        None before the first samples, for a time older than what is kept, and where the newest
        sample is more than 0.2 s older.
        """
        with self._lock:
            if not self._places or not self._turns:
                return None
            stamp = self._clock.vehicle_ns(t_ns)
            oldest = max(self._places[0].stamp_ns, self._turns[0].stamp_ns)
            newest = min(self._places[-1].stamp_ns, self._turns[-1].stamp_ns)
            if stamp < oldest or stamp > newest + _REACH_NS:
                return None
            position = position_at(self._places, stamp)
            q = attitude_at(self._turns, stamp)
        R = rotation_from_quaternion(np.array(q))
        return VehiclePose(t_ns, position, *euler_from_rotation(R))
