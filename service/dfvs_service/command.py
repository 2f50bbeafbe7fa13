"""Signed commands over Zenoh, and their answers."""

import dataclasses
import queue
import secrets
import time
from collections.abc import Mapping
from typing import Any

import zenoh

from dfvs_core.errors import DfvsError
from dfvs_core.gate.commands.command import Command, encode_command, request_id
from dfvs_core.gate.events import Action
from dfvs_core.messages.goal_command import GoalCommand, goal_digest
from dfvs_core.messages.topics import Topics
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.sections import ZenohSection
from dfvs_service.zenoh_session import open_session, subscribe_json

_SENDINGS, _GOAL_SENDINGS = 6, 2
"""A busy link drops what it cannot take at once. The same bytes are obeyed once."""

_Document = Mapping[str, Any]


class CommandError(DfvsError):
    """Command that could not be sent, or was not answered."""


class UnansweredError(CommandError):
    """Command that was sent and not answered: it may be obeyed."""


def operators_zenoh(service: ZenohSection, connect: str | None = None) -> ZenohSection:
    """Settings of a client of an endpoint; by default the service's router, or the service."""
    endpoints = service.reached_at if connect is None else (connect,)
    return dataclasses.replace(service, mode="client", connect=endpoints, listen=())


def send_command(
    config: ServiceConfig,
    key: bytes,
    action: Action,
    timeout_s: float,
    goal: GoalCommand | None = None,
) -> str:
    """Sign a command with the service's present challenge, send it, and return the service's word.

    ``key`` is the secret that the service knows as well. ``timeout_s`` is the longest wait for the
    service, and then for its answer. ``goal`` is where to fly to, for ``Action.GOAL``.

    Raises
    ------
    CommandError
        If no service is heard, or it accepts no commands.
    UnansweredError
        If it does not answer.
    WireError
        If the goal is too large.
    """
    data = b"" if goal is None else goal.to_bytes()
    argument = "" if goal is None else goal_digest(data)
    topics = Topics(config.vehicle.name)
    states: queue.Queue[_Document] = queue.Queue()
    answers: queue.Queue[_Document] = queue.Queue()

    with open_session(operators_zenoh(config.zenoh)) as session:
        # Closing the session ends the subscriptions; the references keep them until then.
        _states = _subscribe(session, topics.telemetry("state"), states)
        _answers = _subscribe(session, topics.telemetry("answer"), answers)
        state = _next(states, time.monotonic() + timeout_s)
        if state is None:
            raise CommandError(
                f"nothing is heard on {topics.telemetry('state')}",
                "a running service",
                "check --vehicle and the zenoh section of --config",
            )
        challenge = str(state.get("challenge", ""))
        if not challenge:
            raise CommandError(
                f"the service of {config.vehicle.name!r} accepts no commands",
                "one that was started with gate.command_key_file",
            )
        nonce = secrets.token_hex(16)
        command = Command(config.vehicle.name, action, challenge, nonce, argument)
        signed = encode_command(key, command)
        key_expr, payload = (topics.command, signed) if goal is None else (topics.new_goal, data)
        attachment = None if goal is None else signed
        drop = zenoh.CongestionControl.DROP
        sendings = _SENDINGS if goal is None else _GOAL_SENDINGS
        for _ in range(sendings):
            session.put(key_expr, payload, attachment=attachment, congestion_control=drop)
            deadline = time.monotonic() + timeout_s / sendings
            while (answer := _next(answers, deadline)) is not None:
                if answer.get("request") == request_id(signed):
                    return str(answer.get("result", ""))
    raise UnansweredError(
        f"the service of {config.vehicle.name!r} did not answer in {timeout_s:g} s",
        "an answer to every command",
        "it may still come to pass: look at the service's state before ordering again",
    )


def _subscribe(
    session: zenoh.Session, key_expr: str, documents: queue.Queue[_Document]
) -> zenoh.Subscriber[None]:
    """Put every JSON object of a key into a queue, on Zenoh's thread."""
    return subscribe_json(session, key_expr, lambda d: None if d is None else documents.put(d))


def _next(documents: queue.Queue[_Document], deadline: float) -> _Document | None:
    """Next document, None where none comes until the monotonic time ``deadline``, s."""
    try:
        return documents.get(timeout=max(deadline - time.monotonic(), 0.0))
    except queue.Empty:
        return None
