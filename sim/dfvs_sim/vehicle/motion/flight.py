"""The flying part of the vehicle: demands of the present mode, control, motion, estimation."""

from dataclasses import dataclass, field

import numpy as np

from dfvs_sim.dynamics.control import Controller, Demand
from dfvs_sim.dynamics.estimate_errors import EstimateGrade, errors_of
from dfvs_sim.dynamics.estimator import Estimator
from dfvs_sim.dynamics.rigid_body import Quadrotor, Vector
from dfvs_sim.dynamics.wind import STRENGTHS, Wind, WindGrade
from dfvs_sim.vehicle.modes import Mode
from dfvs_sim.vehicle.motion.liftoff import LandDetector, Liftoff
from dfvs_sim.vehicle.motion.navigation import Navigator
from dfvs_sim.vehicle.motion.setpoints import is_flyable
from dfvs_sim.vehicle.parameters import ParameterTable, Value
from dfvs_sim.vehicle.status import Status

STOP = Demand(velocity=(0.0, 0.0, 0.0), yaw_rate_rad_s=0.0)
"""Stop and wait."""

_SINKING_M_S, _SINKING_M_S2 = 0.05, 0.5


@dataclass(frozen=True, slots=True)
class VehicleConfig:
    """How the vehicle starts and what it meets.

    ``ground_m`` is the local z of the ground. ``wind`` has a direction and gusts drawn from the
    seed; the steady wind towards north and east is added to it.
    """

    yaw_rad: float = 0.0
    ground_m: float = 0.08
    ready_after_s: float = 1.0
    estimate: EstimateGrade = EstimateGrade.PERFECT
    wind: WindGrade = WindGrade.CALM
    wind_north_m_s: float = 0.0
    wind_east_m_s: float = 0.0
    parameters: dict[str, Value] = field(default_factory=dict)
    system_id: int = 1


class Flight:
    """Advances the vehicle for the mode in ``Status``."""

    def __init__(
        self,
        config: VehicleConfig,
        parameters: ParameterTable,
        status: Status,
        rng: np.random.Generator,
    ) -> None:
        self._parameters = parameters
        self._status = status
        self._setpoint = STOP
        self.demand = STOP
        """What the controller was told in the last step."""
        self._controller = Controller(parameters.gains())
        self._liftoff = Liftoff(parameters)
        self._land_detector = LandDetector()
        self.navigator = Navigator(parameters, status)
        self.vehicle = Quadrotor(ground_m=config.ground_m, yaw_rad=config.yaw_rad)
        of_errors, of_wind = rng.spawn(2)
        strength = STRENGTHS[config.wind]
        self._wind = Wind(strength, config.wind_north_m_s, config.wind_east_m_s, of_wind)
        self.estimator = Estimator(errors_of(config.estimate), of_errors)
        self.estimate = self.estimator.update(0.0, self.vehicle)

    def on_setpoint(self, demand: Demand) -> None:
        """Follow an offboard setpoint; one that cannot be flown makes the vehicle stop and wait."""
        self._setpoint = demand if is_flyable(demand) else STOP

    def update_gains(self) -> None:
        """Use the parameters' present values in the control loops."""
        self._controller.gains = self._parameters.gains()

    def enter(self, mode: Mode, previous: Mode) -> None:
        """Begin a mode. Setpoints from before it do not count: OFFBOARD begins with a stop."""
        self._setpoint = STOP
        self.navigator.enter(mode, self.estimate, previous)

    def prepare(self) -> None:
        """Begin anew, on arming."""
        self._controller.reset()
        self.navigator.enter(self._status.mode, self.estimate, self._status.mode)

    @property
    def velocity_target(self) -> Vector:
        """Velocity that the controller is told, within PX4's limits of speed."""
        return self._controller.limited(self.demand.velocity)

    def takeoff_is_over(self) -> bool:
        """Whether the take-off altitude is reached."""
        return self._liftoff.flying and self.navigator.takeoff_reached(self.estimate)

    def step(self, dt_s: float) -> bool:
        """One step of control, motion and estimation; returns whether the vehicle is landed."""
        s, lift = self._status, self._liftoff
        demand = self.demand = self._demand(dt_s)
        spinning = s.armed and s.mode is not Mode.TERMINATION
        lift.update(dt_s, armed=spinning, landed=s.landed, wants_up=self._wants_up(demand))
        self._controller.climb_limit_m_s = lift.climb_limit_m_s
        command = self._controller.update(dt_s, demand, self.estimate) if lift.flying else None
        self.vehicle.wind_north_m_s, self.vehicle.wind_east_m_s = self._wind.step(dt_s)
        self.vehicle.attitude_error_rad = self.estimator.attitude_error_rad
        self.vehicle.step(dt_s, command)
        self.estimator.update(dt_s, self.vehicle)
        if change := self.estimator.heading_change_rad:
            self.navigator.shift_heading(change)
            self._controller.shift_heading(change)
        landed = self._land_detector.update(
            dt_s,
            on_ground=self.vehicle.on_ground,
            sinking=demand.velocity[2] > _SINKING_M_S or demand.acceleration[2] > _SINKING_M_S2,
            flying=lift.flying,
        )
        if landed and not s.landed:
            self._controller.reset()
        return landed

    def _demand(self, dt_s: float) -> Demand:
        """What the mode asks for; on the ground nothing but offboard setpoints is followed."""
        if self._status.mode is Mode.OFFBOARD:
            return self._setpoint
        if not self._liftoff.flying:
            return STOP
        speed = float(self._parameters["MPC_TKO_SPEED"])
        self.navigator.climb_limit_m_s = min(self._liftoff.climb_limit_m_s, speed)
        return self.navigator.demand(dt_s, self._status.mode, self.estimate)

    def _wants_up(self, demand: Demand) -> bool:
        """Whether a vehicle on the ground is asked to take off."""
        mode = self._status.mode
        if mode is Mode.OFFBOARD:
            above = demand.position[2] < self.estimate.down_m
            return demand.velocity[2] < 0.0 or demand.acceleration[2] < 0.0 or above
        if mode is Mode.TAKEOFF:
            return True
        return mode.needs_manual_control and self.navigator.sticks.up > 0.0
