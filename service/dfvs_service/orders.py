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
    topics = Topics(config.vehicle.name)
    states: queue.Queue[Mapping[str, Any]] = queue.Queue()

    def on_state(sample: zenoh.Sample) -> None:
        states.put(json.loads(sample.payload.to_bytes()))

    with open_session(operators_zenoh(config.zenoh)) as session:
        # Closing the session ends the subscription; the reference keeps it until then.
        _subscriber = session.declare_subscriber(topics.telemetry("state"), on_state)
        state = _next_state(states, time.monotonic() + timeout_s, topics)
        challenge, count = str(state.get("challenge", "")), int(state.get("command_count", 0))
        if not challenge:
            raise OrderError(
                f"the service of {config.vehicle.name!r} accepts no commands",
                "one that was started with gate.command_key_file",
            )
        argument = "" if goal is None else goal_digest(data)
        order = encode_command(key, config.vehicle.name, action, challenge, argument)
        drop = zenoh.CongestionControl.DROP
        if goal is None:
            session.put(topics.command, order, congestion_control=drop)
        else:
            session.put(topics.new_goal, data, attachment=order, congestion_control=drop)
        deadline = time.monotonic() + timeout_s
        while int(state.get("command_count", 0)) == count:
            state = _next_state(states, deadline, topics)
    return str(state.get("command_result", ""))


def _next_state(
    states: queue.Queue[Mapping[str, Any]], deadline: float, topics: Topics
) -> Mapping[str, Any]:
    try:
        return states.get(timeout=max(deadline - time.monotonic(), 0.0))
    except queue.Empty:
        raise OrderError(
            f"no answer on {topics.telemetry('state')}",
            "a running service",
            "check --vehicle and the zenoh section of --config",
        ) from None
