"""A hovering vehicle in simulated time, with the messages that a gate receives from it."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from dfvs_core.gate.events import (
    Attitude,
    Battery,
    CurrentMode,
    EstimatorState,
    Health,
    Heartbeat,
    LandedState,
    LocalPosition,
    ModeRequest,
    OtherServices,
    ParametersRead,
    VehicleEvent,
    VehicleMode,
)
from dfvs_core.gate.limits import BodyVelocity
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import make_pose, rotation_from_euler
from dfvs_core.messages.link import VehicleState
from dfvs_sim.vehicle.modes import Mode
from dfvs_sim.vehicle.motion.flight import VehicleConfig
from dfvs_sim.vehicle.motion.setpoints import BODY_NED, Setpoint, demand_from_setpoint
from dfvs_sim.vehicle.px4 import Px4

_MS = 1_000_000
_S = 1_000_000_000
_TAKE_OFF_S = 40.0
_NAN3 = (float("nan"),) * 3
_VELOCITY_AND_YAW_RATE = 0x5C7
_MODES = {Mode.OFFBOARD: VehicleMode.OFFBOARD, Mode.HOLD: VehicleMode.HOLD}


class HoveringVehicle:
    """The simulated vehicle after take-off to a height above the ground, stepped by the caller.

    ``rng`` draws the errors of its estimator.
    """

    def __init__(self, config: VehicleConfig, rng: np.random.Generator, height_m: float) -> None:
        parameters = {**config.parameters, "MIS_TAKEOFF_ALT": height_m}
        self._px4 = Px4(replace(config, parameters=parameters), 0, rng)
        self.now_ns = 0
        self.advance(round((config.ready_after_s + 1.0) * _S))
        self._px4.arm(self.now_ns)
        self._px4.request_mode(Mode.TAKEOFF, self.now_ns)
        deadline = self.now_ns + round(_TAKE_OFF_S * _S)
        while self._px4.status.mode is not Mode.HOLD and self.now_ns < deadline:
            self.advance(self.now_ns + 100 * _MS)
        self.advance(self.now_ns + 3 * _S)

    @property
    def mode(self) -> VehicleMode:
        """Mode as the gate knows it."""
        return _MODES.get(self._px4.status.mode, VehicleMode.OTHER)

    def advance(self, t_ns: int) -> None:
        """Advance to a time, ns."""
        self._px4.step(t_ns)
        self.now_ns = t_ns

    def T_local_body(self) -> FloatArray:
        """True pose (4, 4) of the body in the local frame."""
        v = self._px4.flight.vehicle
        return make_pose(rotation_from_euler(*v.attitude_rad), np.array(v.position_m))

    def request(self, mode: ModeRequest) -> None:
        """Change the mode as the gate asks for."""
        wanted = Mode.OFFBOARD if mode is ModeRequest.OFFBOARD else Mode.HOLD
        self._px4.request_mode(wanted, self.now_ns)

    def follow(self, setpoint: BodyVelocity) -> None:
        """Take a setpoint, as from SET_POSITION_TARGET_LOCAL_NED in BODY_NED."""
        velocity = (setpoint.forward_m_s, setpoint.right_m_s, setpoint.down_m_s)
        numbers = (_NAN3, velocity, _NAN3, float("nan"), setpoint.yaw_rad_s)
        message = Setpoint(BODY_NED, _VELOCITY_AND_YAW_RATE, *numbers)
        demand = demand_from_setpoint(message, self._px4.flight.estimate.yaw_rad)
        assert demand is not None
        self._px4.status.setpoint_ns = self.now_ns
        if self._px4.status.mode is Mode.OFFBOARD:
            self._px4.flight.on_setpoint(demand)

    def state(self) -> VehicleState:
        """Vehicle state as the autopilot estimates it."""
        e = self._px4.flight.estimate
        return VehicleState(self.now_ns, *e.attitude_rad, e.velocity_m_s, e.position_m)

    def events(self, tick: int) -> Iterator[VehicleEvent]:
        """Messages that the gate receives in its tick of 20 ms with that number."""
        now_ns, s = self.now_ns, self.state()
        armed = self._px4.status.armed
        yield Attitude(now_ns, s.roll_rad, s.pitch_rad, s.yaw_rad)
        yield LocalPosition(now_ns, s.position_m, s.velocity_m_s)
        yield CurrentMode(now_ns, self.mode)
        if tick % 50 == 0:
            yield Heartbeat(now_ns, self.mode, armed=armed)
        if tick % 10 == 0:
            yield EstimatorState(now_ns, valid=True)
            yield Health(now_ns, ok=True)
            yield LandedState(now_ns, in_air=True, on_ground=False)
            yield Battery(now_ns, 0.9)
            yield ParametersRead(now_ns)
            yield OtherServices(now_ns)
