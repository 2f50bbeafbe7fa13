"""Environment of one service: a vehicle that hovers already, its link, and a camera.

One thread steps the vehicle at 250 Hz, answers on MAVLink and takes the images; others hand it
things to do. Everything that reaches or leaves the vehicle goes into its record.
"""

import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pymavlink.dialects.v20 import development as mavlink

from dfvs_robustness.harness.camera import PERIOD_NS, ScriptedCamera
from dfvs_robustness.harness.records import Event, mode_report
from dfvs_robustness.harness.wall import Pose
from dfvs_sim.dynamics.estimate_errors import EstimateGrade
from dfvs_sim.vehicle.messages.streams import COMPANION, GROUND
from dfvs_sim.vehicle.messages.udp_link import UdpLink, UdpPorts, wait_for_data
from dfvs_sim.vehicle.modes import Mode
from dfvs_sim.vehicle.motion.flight import VehicleConfig
from dfvs_sim.vehicle.px4 import STEP_NS, Px4
from dfvs_sim.vehicle.record import VehicleRecord

T = TypeVar("T")

BATTERY = mavlink.FAILURE_UNIT_SYSTEM_BATTERY
GPS = mavlink.FAILURE_UNIT_SENSOR_GPS
MAVLINK_SIGNAL = mavlink.FAILURE_UNIT_SYSTEM_MAVLINK_SIGNAL

AHEAD_NS = 25_000_000_000
_POSE_NS = 100_000_000
LATE_NS = 40_000_000
"""Delay of the environment itself from which on it is noted in the record."""

_PARAMETERS = {
    "COM_OF_LOSS_T": 0.5,
    "COM_OBL_RC_ACT": 5,
    "SYS_FAILURE_EN": 1,
    "MIS_TAKEOFF_ALT": 10.0,  # with room to fly down, where the view never changes
}
_FOREIGN_NS = 20_000_000
_CALL_S = 5.0
_PILOT_S, _PILOT_POLL_S = 2.0, 0.05


class Environment:
    """Vehicle and camera in real time.

    The vehicle's record goes into a file, and its datagrams to the service's UDP port; ``rng`` is
    of its noise and delays.
    """

    def __init__(self, record: Path, port: int, rng: np.random.Generator) -> None:
        self.events: list[Event] = []
        """The record so far: ``t_ns``, ``kind`` and the event's fields."""
        self._file = VehicleRecord(record)
        self._rng = rng
        self._px4 = self._hovering()
        self._link = UdpLink(COMPANION, UdpPorts(0, port))
        self._rogue = mavlink.MAVLink(None, 1, 196)
        self._foreign: Callable[[], Any] | None = None
        self._todo: queue.Queue[Callable[[], None]] = queue.Queue()
        self._offset = (0.0, 0.0, 0.0)
        self._turn_rad = 0.0
        self._pinned: Pose | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="environment", daemon=True)

    def start(self, camera: ScriptedCamera) -> None:
        """Let time pass, and the camera take its images."""
        self._camera = camera
        self._thread.start()

    def close(self) -> None:
        """End it."""
        self._stop.set()
        self._thread.join(2.0)
        self._link.close()
        self._file.close()

    def do(self, action: Callable[[Px4, int], T]) -> T:
        """Have something done to the vehicle between two steps, and wait for it."""
        done: Future[T] = Future()

        def work() -> None:
            try:
                done.set_result(action(self._px4, time.monotonic_ns()))
            except Exception as error:  # noqa: BLE001 - it belongs to whoever waits
                done.set_exception(error)

        self._todo.put(work)
        return done.result(_CALL_S)

    def note(self, kind: str, **fields: Any) -> int:
        """Put an event of ours into the record; returns its time."""
        t_ns = time.monotonic_ns()
        self._note(t_ns, kind, fields)
        return t_ns

    def last(self, kind: str) -> Event:
        """Newest event of a kind in the record; empty where there is none."""
        return next((event for event in reversed(self.events) if event["kind"] == kind), {})

    def place(self, position_m: tuple[float, float, float], yaw_rad: float) -> None:
        """Move the scene so that the vehicle is here in it, from now on."""

        def work(px4: Px4, _: int) -> None:
            v = px4.flight.vehicle
            self._turn_rad = yaw_rad - v.yaw_rad
            turned = self._turned(v.north_m, v.east_m)
            local = (*turned, v.down_m)
            x, y, z = (p - q for p, q in zip(position_m, local, strict=True))
            self._offset = (x, y, z)

        self.do(work)

    def pin(self) -> None:
        """Let the camera see what it sees now, wherever the vehicle goes, until the mending."""
        self._pinned = self.do(lambda _px4, _now: self.pose())

    def pose(self) -> Pose:
        """Where the camera's vehicle is in the scene (environment's thread only)."""
        if self._pinned is not None:
            return self._pinned
        v = self._px4.flight.vehicle
        north, east = self._turned(v.north_m, v.east_m)
        x, y, z = self._offset
        position = (north + x, east + y, v.down_m + z)
        return Pose(position, v.roll_rad, v.pitch_rad, v.yaw_rad + self._turn_rad)

    def send_as_other(self, message: Any, sender: tuple[int, int] | None = None) -> None:
        """Let the vehicle's link carry a message of another component, as PX4 forwards them.

        ``sender`` is its (system, component); without it, one under the vehicle's own system.
        """
        speaker = self._rogue if sender is None else mavlink.MAVLink(None, *sender)
        self.do(lambda _px4, _now: self._link.send_bytes(message.pack(speaker)))

    def send_foreign(self, make: Callable[[], Any] | None) -> None:
        """Let somebody else send a message to the vehicle at 50 Hz on another link, or stop it."""
        self._foreign = make

    def inject(self, unit: int, kind: int, instance: int = 0) -> int:
        """MAV_CMD_INJECT_FAILURE, as the vehicle offers it to a ground station; returns when."""
        message = mavlink.MAVLink_command_long_message(
            1, 1, mavlink.MAV_CMD_INJECT_FAILURE, 0, unit, kind, instance, 0.0, 0.0, 0.0, 0.0
        )
        message.pack(mavlink.MAVLink(None, 255, 190))
        self.do(lambda px4, now_ns: px4.handle(message, GROUND, now_ns))
        return time.monotonic_ns()

    def repair(self) -> bool:
        """Take back what was injected; tell whether the vehicle had to be replaced.

        One that fell is replaced by one that hovers, which knows nothing of the streams that the
        service asked the other one for.
        """
        for unit in (BATTERY, GPS, MAVLINK_SIGNAL):
            self.inject(unit, mavlink.FAILURE_TYPE_OK)
        self._pinned = None
        self.send_foreign(None)
        self.stream("HEARTBEAT", 0.0)
        return self.do(self._replace_if_fallen)

    def silence(self) -> int:
        """End the vehicle's link to the companion, until it is restored; returns when."""
        return self.inject(MAVLINK_SIGNAL, mavlink.FAILURE_TYPE_OFF, 1)

    def stream(self, name: str, interval_us: float) -> None:
        """Set the interval of a stream to the companion; -1 stops it, 0 restores it."""
        self.do(
            lambda px4, now_ns: px4.links[COMPANION].schedule.set_interval(
                name, interval_us, now_ns
            )
        )

    def pilot_mode(self, mode: Mode) -> None:
        """Let the pilot switch the mode, again until the vehicle follows or two seconds passed."""

        def switch(px4: Px4, now_ns: int) -> bool:
            px4.request_mode(mode, now_ns)
            return px4.status.mode is mode and not px4.status.failsafe

        deadline = time.monotonic() + _PILOT_S
        while not self.do(switch) and time.monotonic() < deadline:
            time.sleep(_PILOT_POLL_S)

    def _replace_if_fallen(self, px4: Px4, _: int) -> bool:
        if px4.status.armed and not px4.status.landed:
            return False
        self._px4 = self._hovering()
        self._px4.step(time.monotonic_ns())
        return True

    def _hovering(self) -> Px4:
        begin_ns = time.monotonic_ns() - AHEAD_NS
        config = VehicleConfig(parameters=_PARAMETERS, estimate=EstimateGrade.MEDIUM)
        px4 = Px4(config, begin_ns, self._rng, self._note)
        take_off(px4, begin_ns)
        return px4

    def _turned(self, north: float, east: float) -> tuple[float, float]:
        c, s = np.cos(self._turn_rad), np.sin(self._turn_rad)
        return float(c * north - s * east), float(s * north + c * east)

    def _note(self, t_ns: int, kind: str, fields: dict[str, Any]) -> None:
        self.events.append({"t_ns": t_ns, "kind": kind, **fields})
        self._file(t_ns, kind, fields)

    def _run(self) -> None:
        next_ns = time.monotonic_ns()
        next_frame_ns = next_pose_ns = next_foreign_ns = next_ns
        self._px4.step(next_ns)
        while not self._stop.is_set():
            wait_for_data([self._link], (next_ns - time.monotonic_ns()) / 1e9)
            self._answer()
            while not self._todo.empty():
                self._todo.get_nowait()()
            now_ns = time.monotonic_ns()
            if now_ns < next_ns:
                continue
            if now_ns - next_ns > LATE_NS:
                self._note(now_ns, "world_late", {"by_ns": now_ns - next_ns})
            next_ns = max(next_ns + STEP_NS, now_ns)
            self._publish(now_ns)
            if self._foreign is not None and now_ns >= next_foreign_ns:
                next_foreign_ns = now_ns + _FOREIGN_NS
                message = self._foreign()
                message.pack(self._rogue)
                self._px4.handle(message, GROUND, now_ns)
            if now_ns >= next_frame_ns:
                next_frame_ns = max(next_frame_ns + PERIOD_NS, now_ns)
                self._camera.capture(self.pose(), time.monotonic_ns())
            if now_ns >= next_pose_ns:
                next_pose_ns = now_ns + _POSE_NS
                v = self._px4.flight.vehicle
                velocity = [round(a, 4) for a in v.velocity_m_s]
                place = [round(a, 4) for a in v.position_m]
                self._note(now_ns, "pose", {"velocity": velocity, "place": place})

    def _answer(self) -> None:
        for message in self._link.receive():
            now_ns = time.monotonic_ns()  # not before: no setpoint came earlier than it was sent
            for answer in self._px4.handle(message, COMPANION, now_ns):
                self._link.send(answer)

    def _publish(self, now_ns: int) -> None:
        for name, message in self._px4.step(now_ns):
            if name != COMPANION:
                continue
            sent_ns = time.monotonic_ns()
            self._link.send(message)
            if (reported := mode_report(message)) is not None:
                self._note(sent_ns, *reported)


def take_off(px4: Px4, begin_ns: int) -> None:
    """Fly from the ground to a hover within ``AHEAD_NS``, as fast as it can be computed."""
    t_ns, asked = begin_ns, False
    while t_ns < begin_ns + AHEAD_NS:
        t_ns += STEP_NS
        px4.step(t_ns)
        if not asked and px4.status.ready and px4.arm(t_ns) is None:
            asked = True
            px4.request_mode(Mode.TAKEOFF, t_ns)
    if px4.status.mode is not Mode.HOLD or px4.status.landed:
        raise RuntimeError(f"the vehicle does not hover: {px4.status}")
