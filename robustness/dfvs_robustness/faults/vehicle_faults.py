"""Faults of the vehicle, its link and its pilot, and others who command."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Sequence

import numpy as np
from pymavlink.dialects.v20 import development as mavlink

from dfvs_core.gate.events import Action
from dfvs_core.gate.states import Cause, GateState
from dfvs_core.messages.goal_command import goal_digest
from dfvs_robustness.faults.fault import ANY_ENGAGED, Fault, Reaction
from dfvs_robustness.harness.environment import BATTERY, GPS
from dfvs_robustness.harness.harness import Harness
from dfvs_robustness.harness.records import TELLS_MODE
from dfvs_robustness.harness.service import KEY, signed, wait_until
from dfvs_robustness.harness.setup import NO_RESPONSE_CHECK, Setup
from dfvs_sim.vehicle.modes import Mode
from dfvs_sim.vehicle.px4 import Px4

S = GateState
MS = 1_000_000
_READY_OR_ENGAGED = (S.READY, *ANY_ENGAGED)
_HEARTBEAT_S = 1.5
_OFF, _WRONG = mavlink.FAILURE_TYPE_OFF, mavlink.FAILURE_TYPE_WRONG
_BODY_VELOCITY = 0x5C7
_STICKS_NS = 10_000 * MS
_STATIONS = ((255, 190), (245, 191), (1, 196))
"""System and component of others who send: two ground stations, and one under our vehicle's id."""
_STATION_NS, _STATION_PERIOD_S = 1500 * MS, 0.02
_SETPOINTS = ("setpoints of somebody else", "somebody else sends setpoints")
_FOREIGN_M_S, _ELSEWHERE_M_S = 0.42, 0.4
"""Speed of another commander, and how far it is from ours; below 0.2 m/s nobody could tell."""


def _link_lost(harness: Harness, _: np.random.Generator) -> int:
    harness.environment.silence()
    return time.monotonic_ns()


def _heartbeat_lost(harness: Harness, _: np.random.Generator) -> int:
    harness.environment.stream("HEARTBEAT", -1.0)
    beats = [e["t_ns"] for e in harness.environment.events[-3000:] if e["kind"] == "heartbeat_sent"]
    return int(beats[-1])


def _next_told(harness: Harness, since_ns: int, kinds: Sequence[str]) -> int:
    """When the first message of these kinds after a time was sent."""

    def found() -> list[int]:
        recent = harness.environment.events[-3000:]
        return [e["t_ns"] for e in recent if e["kind"] in kinds and e["t_ns"] > since_ns]

    wait_until(lambda: bool(found()), _HEARTBEAT_S)
    return found()[0]


def _taken_over(harness: Harness, rng: np.random.Generator) -> int:
    modes = [Mode.LAND, Mode.RETURN, Mode.ALTITUDE, Mode.STABILIZED, Mode.POSITION, Mode.HOLD]
    which = int(rng.integers(len(modes)))

    def take(px4: Px4, now_ns: int) -> int:
        # Who selects the mode that is on already changes nothing that anybody could see.
        others = [mode for mode in modes if mode is not px4.status.mode]
        mode = others[which % len(others)]
        px4.status.manual_ns = now_ns + _STICKS_NS  # sticks are held from now on
        px4.request_mode(mode, now_ns)
        return time.monotonic_ns()

    return _next_told(harness, harness.environment.do(take), TELLS_MODE)


def _disarmed(harness: Harness, _: np.random.Generator) -> int:
    since_ns = time.monotonic_ns()
    harness.environment.do(lambda px4, now_ns: px4.disarm(now_ns, "kill switch", force=True))
    return _next_told(harness, since_ns, ("heartbeat_sent",))


def _estimator_invalid(harness: Harness, _: np.random.Generator) -> int:
    harness.environment.inject(GPS, _OFF)
    return time.monotonic_ns()


def _estimator_jumps(harness: Harness, _: np.random.Generator) -> int:
    harness.environment.inject(GPS, _WRONG)
    return time.monotonic_ns()


def _battery_low(harness: Harness, _: np.random.Generator) -> int:
    harness.environment.inject(BATTERY, _OFF)
    return time.monotonic_ns()


# --- others who command ---------------------------------------------------------------------


def _second_service(harness: Harness, _: np.random.Generator) -> int:
    harness.hold_token(harness.topics.lease("engaged", "second"))
    return time.monotonic_ns()


def _service_stands_by(harness: Harness, _: np.random.Generator) -> int:
    harness.hold_token(harness.topics.lease("standby", "second"))
    return time.monotonic_ns()


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
    ours = next(e for e in reversed(harness.environment.events) if e["kind"] == "setpoint")[
        "velocity"
    ]
    off = 0.0
    while off < _ELSEWHERE_M_S:
        angle = rng.uniform(0.0, math.tau)
        forward, right = _FOREIGN_M_S * math.cos(angle), _FOREIGN_M_S * math.sin(angle)
        off = math.dist(ours, (forward, right, 0.0))
    harness.environment.shadow(lambda: _foreign_message(forward, right))
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
    """Send the last order again, and new ones with challenges never told, used and expired."""
    harness.operator.send(harness.operator.last_order)
    expired = harness.operator.told[:-2][-4:]  # the last but one may still be good
    for challenge in ("0" * 32, harness.operator.used_challenge, *expired):
        harness.operator.send(signed(KEY, harness.topics.vehicle, Action.ABORT, challenge))
    return time.monotonic_ns()


def _operator_aborts(harness: Harness, _: np.random.Generator) -> int:
    t_ns = time.monotonic_ns()
    harness.operator.order(Action.ABORT)
    return t_ns


def vehicle_faults() -> tuple[Fault, ...]:
    """Faults of vehicle, pilot and commanders, by the rows of the table."""
    return tuple(dataclasses.replace(fault, spares_frames=True) for fault in _faults())


def _faults() -> tuple[Fault, ...]:
    abort, released = Reaction.ABORT, Reaction.RELEASED
    flown = ANY_ENGAGED
    return (
        Fault(
            "link-lost",
            "autopilot link lost",
            "telemetry over 0.5 s old",
            abort,
            700.0,
            _READY_OR_ENGAGED,
            _link_lost,
            says=(str(Cause.TELEMETRY_LOST), "frames:"),
        ),
        Fault(
            "heartbeat-lost",
            "no heartbeat, telemetry goes on",
            "heartbeat over 2 s old",
            abort,
            2100.0,
            _READY_OR_ENGAGED,
            _heartbeat_lost,
            says=(str(Cause.HEARTBEAT_LOST),),
        ),
        Fault(
            "takeover",
            "pilot takes over",
            "mode",
            released,
            50.0,
            flown,
            _taken_over,
            says=(str(Cause.TAKEOVER),),
        ),
        Fault(
            "disarmed",
            "disarmed in the air",
            "state",
            released,
            50.0,
            flown,
            _disarmed,
            says=(str(Cause.DISARMED),),
        ),
        Fault(
            "estimator-invalid",
            "estimator loses the position",
            "estimator's flags, mode",
            Reaction.ENDED,
            200.0,
            _READY_OR_ENGAGED,
            _estimator_invalid,
            says=(str(Cause.ESTIMATOR_INVALID), str(Cause.TAKEOVER)),
        ),
        Fault(
            "estimator-jumps",
            "position estimate jumps 2 m",
            "jump",
            abort,
            200.0,
            flown,
            _estimator_jumps,
            says=(str(Cause.ESTIMATOR_JUMP),),
        ),
        Fault(
            "battery-low",
            "battery low",
            "threshold",
            abort,
            1000.0,
            _READY_OR_ENGAGED,
            _battery_low,
            says=(str(Cause.BATTERY_LOW),),
        ),
        Fault(
            "second-service",
            "another service engages",
            "lease",
            abort,
            500.0,
            (S.READY, *ANY_ENGAGED),
            _second_service,
            says=(str(Cause.TWO_COMMANDERS), "another service"),
        ),
        Fault(
            "service-stands-by",
            "another service stands by",
            "lease",
            Reaction.REFUSED,
            0.0,
            (S.READY,),
            _service_stands_by,
            watch_s=1.0,
        ),
        Fault(
            "service-starts-in-flight",
            "another service comes up in flight",
            "lease",
            Reaction.IGNORED,
            0.0,
            (S.SERVO,),
            _service_stands_by,
            watch_s=1.0,
        ),
        Fault(
            "foreign-setpoint",
            "somebody else's setpoint on the link",
            "foreign setpoint",
            abort,
            100.0,
            _READY_OR_ENGAGED,
            _foreign_setpoint,
            says=_SETPOINTS,
        ),
        Fault(
            "foreign-system",
            "setpoints of a ground station on the link",
            "foreign setpoint of any system",
            abort,
            1000.0,
            _READY_OR_ENGAGED,
            _foreign_system,
            says=_SETPOINTS,
        ),
        Fault(
            "foreign-commander",
            "somebody else's setpoints on another link, 0.4 m/s off",
            "velocity nobody here asked for",
            abort,
            4000.0,
            (S.SERVO, S.HOLD, S.DONE),
            _foreign_elsewhere,
            Setup(settings=(NO_RESPONSE_CHECK,)),
            says=(str(Cause.TWO_COMMANDERS),),
        ),
        Fault(
            "forged-commands",
            "commands and goals of a wrong key or vehicle",
            "authority",
            Reaction.IGNORED,
            0.0,
            (S.READY, S.SERVO, S.HOLD, S.DONE),
            _forged,
            watch_s=0.5,
        ),
        Fault(
            "replayed-commands",
            "an order again; old and unknown challenges",
            "challenge",
            Reaction.IGNORED,
            0.0,
            (S.READY, S.SERVO, S.HOLD, S.DONE),
            _replayed,
            watch_s=0.5,
        ),
        Fault(
            "operator-aborts",
            "operator orders to abort",
            "signed command",
            abort,
            500.0,
            ANY_ENGAGED,
            _operator_aborts,
            says=(str(Cause.OPERATOR_ABORT),),
        ),
    )
