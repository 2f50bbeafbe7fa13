"""Faults of commanders: other services, foreign setpoints, hostile commands, the operator."""

import math
import time

import numpy as np
from pymavlink.dialects.v20 import development as mavlink

from dfvs_core.gate.events import Action
from dfvs_core.gate.states import GateState
from dfvs_core.messages.goal_command import goal_digest
from dfvs_robustness.faults.fault import Inject
from dfvs_robustness.harness.harness import Harness
from dfvs_robustness.harness.service import KEY, signed
from dfvs_sim.vehicle.messages.telemetry import Message

S = GateState
_BODY_VELOCITY = 0x5C7
_STATIONS = ((255, 190), (245, 191), (1, 196))
"""System and component of others who send: two ground stations, and one under our vehicle's id."""
_STATION_NS, _STATION_PERIOD_S = 1_500_000_000, 0.02
_FOREIGN_M_S, _ELSEWHERE_M_S = 0.42, 0.4
"""Speed of another commander, and how far it is from ours; below 0.2 m/s nobody could tell."""


# --- other commanders -----------------------------------------------------------------------


def _other_service(role: str) -> Inject:
    return lambda harness, _: harness.hold_token(harness.topics.lease(role, "second"))


def _foreign_message(forward_m_s: float, right_m_s: float) -> Message:
    zeros = (0.0,) * 3
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, 8, _BODY_VELOCITY, *zeros, forward_m_s, right_m_s, 0.0, *zeros, 0.0, 0.2
    )


def _foreign_setpoint(harness: Harness, rng: np.random.Generator) -> int:
    forward, right = rng.uniform(-0.5, 0.5, 2)
    harness.environment.send_as_other(_foreign_message(float(forward), float(right)))
    return time.monotonic_ns()


def _foreign_system(harness: Harness, rng: np.random.Generator) -> int:
    """Somebody under a system id of their own sends setpoints, at 50 Hz for a while."""
    forward, right = rng.uniform(-0.5, 0.5, 2)
    sender = _STATIONS[int(rng.integers(len(_STATIONS)))]
    t_ns = time.monotonic_ns()
    while time.monotonic_ns() < t_ns + _STATION_NS and harness.state not in (S.ABORT, S.PREFLIGHT):
        harness.environment.send_as_other(_foreign_message(float(forward), float(right)), sender)
        time.sleep(_STATION_PERIOD_S)
    return t_ns


def _foreign_elsewhere(harness: Harness, rng: np.random.Generator) -> int:
    """Somebody who wants to go elsewhere sends setpoints at 50 Hz on a link of their own."""
    ours = harness.environment.last("setpoint")["velocity"]
    off = 0.0
    while off < _ELSEWHERE_M_S:
        angle = rng.uniform(0.0, math.tau)
        forward, right = _FOREIGN_M_S * math.cos(angle), _FOREIGN_M_S * math.sin(angle)
        off = math.dist(ours, (forward, right, 0.0))
    harness.environment.send_foreign(lambda: _foreign_message(forward, right))
    return time.monotonic_ns()


# --- hostile commands -----------------------------------------------------------------------


def _forged(harness: Harness, rng: np.random.Generator) -> int:
    for key, vehicle in ((rng.bytes(32), harness.topics.vehicle), (KEY, "another")):
        for action in (Action.ABORT, Action.ENGAGE, Action.HOLD):
            challenge = str(harness.operator.status["challenge"])
            harness.operator.send(signed(key, vehicle, action, challenge))
        goal, challenge = rng.bytes(1000), str(harness.operator.status["challenge"])
        command = signed(key, vehicle, Action.GOAL, challenge, goal_digest(goal))
        harness.operator.send_goal(goal, command)
    for size in (0, 1, 500, 100_000):
        harness.operator.send(rng.bytes(size))
    return time.monotonic_ns()


def _replayed(harness: Harness, _: np.random.Generator) -> int:
    """Send the last command again, and new ones with challenges never told, used and expired."""
    harness.operator.send(harness.operator.last_command)
    expired = harness.operator.challenges[:-2][-4:]  # the last but one may still be good
    for challenge in ("0" * 32, harness.operator.used_challenge, *expired):
        harness.operator.send(signed(KEY, harness.topics.vehicle, Action.ABORT, challenge))
    return time.monotonic_ns()


def _operator_aborts(harness: Harness, _: np.random.Generator) -> int:
    t_ns = time.monotonic_ns()
    harness.operator.command(Action.ABORT)
    return t_ns


COMMANDER_FAULTS: dict[str, Inject] = {
    "second-service": _other_service("engaged"),
    "service-stands-by": _other_service("standby"),
    "service-starts-in-flight": _other_service("standby"),
    "foreign-setpoint": _foreign_setpoint,
    "foreign-system": _foreign_system,
    "foreign-commander": _foreign_elsewhere,
    "forged-commands": _forged,
    "replayed-commands": _replayed,
    "operator-aborts": _operator_aborts,
}
