"""The law's gain and prediction on the simulated quadrotor's own dynamics, without pictures.

Frames at 20 Hz and 110 ms old, the gate's limits, the vehicle let go from rest. What the flow and
the depth are wrong by is left out: how fast the error may be flown away is the question.
"""

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np
import pytest

from dfvs_bench.drone.bound import trapezoid_s
from dfvs_core.gate.limits import ZERO, BodyVelocity, VelocityLimits, saturate, slew
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.velocity import velocity_for
from dfvs_sim.dynamics.control import Controller, Demand, Gains
from dfvs_sim.dynamics.estimate_errors import EstimateErrors
from dfvs_sim.dynamics.estimator import Estimator
from dfvs_sim.dynamics.rigid_body import Quadrotor

STEP_S, FRAME_S, SETPOINT_S = 0.004, 0.05, 0.02
AGE_S = 0.11
LIMITS = VelocityLimits()
CONFIG = ServoConfig()


@dataclass
class Approach:
    """One approach along the north axis, with a turn; errors in m and rad at every step."""

    distance_m: float
    angle_rad: float = math.radians(20.0)
    hidden_s: float = 0.0
    gains: Gains = field(default_factory=Gains)
    errors: list[tuple[float, float]] = field(default_factory=list)
    asked_m_s: list[float] = field(default_factory=list)

    def fly(self, seconds=15.0):
        vehicle, controller = Quadrotor(ground_m=100.0), Controller(self.gains)
        vehicle.down_m, vehicle.on_ground = 0.0, False
        estimator = Estimator(EstimateErrors(), np.random.default_rng(0))
        asked, sent, seen = ZERO, ZERO, deque()
        for k in range(round(seconds / STEP_S)):
            t = k * STEP_S
            if k % round(FRAME_S / STEP_S) == 0:
                motion = self.distance_m - vehicle.north_m, self.angle_rad - vehicle.yaw_rad
                seen.append((t + AGE_S + self.hidden_s, np.array(motion)))
            while seen and seen[0][0] <= t:
                asked = self._law(seen.popleft()[1], vehicle)
                self.asked_m_s.append(asked.forward_m_s)
            if k % round(SETPOINT_S / STEP_S) == 0:
                sent = slew(sent, saturate(asked, LIMITS), SETPOINT_S, LIMITS)
            demand = Demand(velocity=(sent.forward_m_s, 0.0, 0.0), yaw_rate_rad_s=sent.yaw_rad_s)
            estimate = estimator.update(STEP_S, vehicle)
            vehicle.step(STEP_S, controller.update(STEP_S, demand, estimate))
            gone = self.distance_m - vehicle.north_m, self.angle_rad - vehicle.yaw_rad
            self.errors.append(gone)
        return self

    def _law(self, motion, vehicle):
        velocity = np.array([vehicle.v_north_m_s, vehicle.yaw_rate_rad_s])
        late_s = np.array([CONFIG.response_s, CONFIG.yaw_response_s]) + AGE_S
        forward, yaw = velocity_for(motion, velocity, late_s, CONFIG)
        return BodyVelocity(forward_m_s=float(forward), yaw_rad_s=float(yaw))

    @property
    def within_s(self):
        outside = [
            k
            for k, (e_m, e_rad) in enumerate(self.errors)
            if abs(e_m) > 0.05 or abs(e_rad) > math.radians(1.0)
        ]
        return (outside[-1] + 1) * STEP_S

    @property
    def swinging_m_s(self):
        """Way up and down of the asked speed, once the vehicle has been within 10 cm."""
        near = next(k for k, (e_m, _) in enumerate(self.errors) if abs(e_m) < 0.1)
        return float(np.abs(np.diff(self.asked_m_s[round(near * STEP_S / FRAME_S) :])).sum())

    @property
    def overshoot_m(self):
        return -min(e_m for e_m, _ in self.errors)


@pytest.mark.parametrize("distance_m", [1.0, 1.5, 2.5])
def test_the_goal_is_approached_fast_and_not_flown_past(distance_m):
    approach = Approach(distance_m).fly()
    bound_s = trapezoid_s(distance_m, LIMITS.horizontal_m_s, LIMITS.slew_m_s2)
    assert approach.within_s < 1.52 * bound_s
    assert approach.overshoot_m < 0.03
    assert approach.swinging_m_s < 0.2


def test_a_delay_that_nobody_told_of_is_borne():
    approach = Approach(1.5, hidden_s=0.2).fly()
    assert approach.within_s < 8.0
    assert approach.overshoot_m < 0.04


@pytest.mark.parametrize(
    "gains",
    [Gains(xy_velocity=1.2), Gains(xy_velocity=3.0), Gains(delay_s=0.2), Gains(xy_integral=1.0)],
    ids=["slower", "quicker", "later", "more integral"],
)
def test_a_vehicle_that_answers_otherwise_is_borne(gains):
    approach = Approach(1.5, gains=gains).fly()
    assert approach.within_s < 6.0
    assert approach.overshoot_m < 0.03
    assert approach.swinging_m_s < 0.3
