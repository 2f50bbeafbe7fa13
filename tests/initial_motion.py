"""A vehicle that follows velocities, in front of an initial-response check alone."""

import dataclasses
import math

from gate_rehearsal import Rehearsal

from dfvs_core.gate.checks.initial_response import InitialResponse
from dfvs_core.gate.config import MS, GateTiming, S
from dfvs_core.gate.limits import BodyVelocity

TIMING = GateTiming()
STEP_NS = 20 * MS

STRAIGHT = (0.1, 0.0, 0.0, 0.0)
TURN = (0.0, 0.0, 0.0, -0.2)
BOTH = (0.1, 0.0, 0.0, 0.2)
"""Velocities that are asked for: forward, right, down in m/s, yaw rate in rad/s."""


class Motion:
    """A check that is followed at 50 Hz by a vehicle at a heading."""

    def __init__(self, yaw_rad=0.0):
        self.check = InitialResponse(0)
        self.now_ns = 0
        self.yaw_rad = yaw_rad

    def run(self, seconds, asked=STRAIGHT, share=1.0):
        """Ask for a velocity; the vehicle flies a share of it."""
        for _ in range(round(seconds * S / STEP_NS)):
            f, r, d, w = (share * v for v in asked)
            c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
            own = (c * f - s * r, s * f + c * r, d), self.yaw_rad
            self.check.integrate(BodyVelocity(*asked), *own, self.now_ns)
            self.now_ns += STEP_NS
            self.yaw_rad += w * STEP_NS / S
        return self

    def see(self, errors=((1.0, 0.3, None),), score=None):
        report = Rehearsal().report(mounting_score=score).report
        for error_m, error_rad, feature in errors:
            self.check.update(
                dataclasses.replace(
                    report, error_m=error_m, error_rad=error_rad, feature_error=feature
                )
            )
        return self

    def judge(self):
        return self.check.evaluate(self.now_ns, TIMING)


def ramp(a, b, n=10):
    return [a + (b - a) * i / (n - 1) for i in range(n)]


def errors(distance=(1.0, 1.0), angle=(0.3, 0.3), feature=None):
    """Ten reports' errors, each linear from a first to a last value."""
    features = [None] * 10 if feature is None else ramp(*feature)
    return list(zip(ramp(*distance), ramp(*angle), features, strict=True))


def noisy(fall, flutter=0.01):
    """Ten errors whose medians of five fall, with equal steps up and down between reports."""
    up = [flutter * (i % 2) for i in range(5)]
    return [1.0 + v for v in up] + [1.0 + flutter - fall - v for v in up]
