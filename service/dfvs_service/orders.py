"""``dfvs-service command``: sends a signed order over Zenoh and waits for what becomes of it."""

from __future__ import annotations

import dataclasses
import json
import queue
import time
from collections.abc import Mapping
from typing import Any

import zenoh

from dfvs_core.errors import DfvsError
from dfvs_core.gate.events import Action
from dfvs_core.topics import Topics
from dfvs_core.wire.command import encode_command
from dfvs_core.wire.goal_order import GoalOrder, goal_digest
from dfvs_service.config import ServiceConfig, ZenohSection
from dfvs_service.zenoh_session import open_session

_SENDINGS = 2
"""A busy link drops what it cannot take at once. What arrives twice has its challenge used up."""


class OrderError(DfvsError):
    """An order that could not be given, or was not answered."""


def operators_zenoh(service: ZenohSection) -> ZenohSection:
    """Settings with which an operator reaches the service: its router, or the service itself."""
    endpoints = service.connect if service.mode == "client" else service.listen
    return dataclasses.replace(service, mode="client", connect=endpoints, listen=())


def give_order(
    config: ServiceConfig,
    key: bytes,
    action: Action,
    timeout_s: float,
    goal: GoalOrder | None = None,
) -> str:
    """Sign an order with the service's present challenge, send it, and return the service's word.

    Parameters
    ----------
    config : ServiceConfig
        Name of the vehicle, and the way to it.
    key : bytes
        Secret that the service knows as well.
    action : Action
        What to do.
    timeout_s : float
        How long to wait for the service, and then for its answer.
    goal : GoalOrder, optional
        Where to fly to, for ``Action.GOAL``.

    Raises
    ------
    OrderError
        If no service is heard, it accepts no orders, or it does not answer.
    WireError
        If the goal is too large.
    """
    data = b"" if goal is None else goal.to_bytes()
    argument = "" if goal is None else goal_digest(data)
    topics = Topics(config.vehicle.name)
    states: queue.Queue[Mapping[str, Any]] = queue.Queue()

    def on_state(sample: zenoh.Sample) -> None:
        states.put(json.loads(sample.payload.to_bytes()))

    with open_session(operators_zenoh(config.zenoh)) as session:
        # Closing the session ends the subscription; the reference keeps it until then.
        _subscriber = session.declare_subscriber(topics.telemetry("state"), on_state)
        state = _next_state(states, time.monotonic() + timeout_s)
        if state is None:
            raise OrderError(
                f"nothing is heard on {topics.telemetry('state')}",
                "a running service",
                "check --vehicle and the zenoh section of --config",
            )
        challenge, count = str(state.get("challenge", "")), _count(state)
        if not challenge:
            raise OrderError(
                f"the service of {config.vehicle.name!r} accepts no commands",
                "one that was started with gate.command_key_file",
            )
        order = encode_command(key, config.vehicle.name, action, challenge, argument)
        key_expr, payload = (topics.command, order) if goal is None else (topics.new_goal, data)
        attachment = None if goal is None else order
        drop = zenoh.CongestionControl.DROP
        for _ in range(_SENDINGS):
            session.put(key_expr, payload, attachment=attachment, congestion_control=drop)
            deadline = time.monotonic() + timeout_s / _SENDINGS
            while (state := _next_state(states, deadline)) is not None:
                if _count(state) != count:
                    return str(state.get("command_result", ""))
    raise OrderError(
        f"the service of {config.vehicle.name!r} did not answer in {timeout_s:g} s",
        "an answer to every command",
        "it may still come to pass: look at the service's state before ordering again",
    )


def _next_state(
    states: queue.Queue[Mapping[str, Any]], deadline: float
) -> Mapping[str, Any] | None:
    """Next state that is heard, None where none is until then."""
    try:
        return states.get(timeout=max(deadline - time.monotonic(), 0.0))
    except queue.Empty:
        return None


def _count(state: Mapping[str, Any]) -> int:
    """How many commands the service has judged."""
    return int(state.get("command_count", 0))
