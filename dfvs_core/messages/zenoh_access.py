"""Zenoh access control: roles by the common name of their certificate.

Everything that is not allowed here is denied. The rules are enforced where links end: by a router,
or by the service itself where others connect to it directly.
"""

import enum
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from dfvs_core.messages.topics import Topics


class Role(enum.StrEnum):
    """Kinds of processes that have a certificate."""

    ROUTER = "router"
    SERVICE = "service"
    CAMERA = "camera"
    DASHBOARD = "dashboard"
    OPERATOR = "operator"
    RECORDER = "recorder"
    FOXGLOVE = "foxglove"
    METRICS = "metrics"
    ROS2 = "ros2"


_STREAMS = {
    Role.FOXGLOVE: ("opening", "turn", "flow"),
    Role.METRICS: ("state", "servo", "timing"),
    Role.ROS2: ("state", "servo", "timing", "preview"),
}
"""Roles that listen to a few streams of telemetry and do nothing else."""

_PUBLISHER_MESSAGES = ("put", "delete", "declare_queryable", "reply", "liveliness_token")
"""Messages of whoever publishes something; the other way round they reach whoever listens."""
_SUBSCRIBER_MESSAGES = (
    "declare_subscriber",
    "query",
    "declare_liveliness_subscriber",
    "liveliness_query",
)


@dataclass(frozen=True, slots=True)
class Access:
    """Keys that a role publishes and listens to, and exceptions from what wildcards cover."""

    publishes: tuple[str, ...] = ()
    subscribes: tuple[str, ...] = ()
    never_publishes: tuple[str, ...] = ()
    never_subscribes: tuple[str, ...] = ()


def role_access(role: Role, topics: Topics) -> Access:
    """What a role of one vehicle may publish and listen to; a router takes no part itself."""
    commands = (topics.command, topics.new_goal)
    camera = (topics.camera, topics.calibration)
    telemetry = topics.telemetry("*")  # covers the camera's frames, not its calibration
    if role is Role.SERVICE:
        inputs, lease = (*camera, *commands), topics.lease("*", "*")
        return Access((telemetry, lease), (*inputs, lease), never_publishes=inputs)
    if role is Role.CAMERA:
        return Access(publishes=camera)
    if role in _STREAMS:
        return Access(subscribes=tuple(topics.telemetry(name) for name in _STREAMS[role]))
    if role is Role.RECORDER:
        return Access(subscribes=(telemetry, topics.calibration), never_subscribes=commands)
    if role is Role.OPERATOR:
        return Access(commands, (telemetry,), never_subscribes=commands)
    if role is Role.DASHBOARD:
        return Access(subscribes=(telemetry,), never_subscribes=commands)
    return Access()


def certificate_name(role: Role, vehicle: str) -> str:
    """Common name of a role's certificate; a router serves many vehicles."""
    return str(role) if role is Role.ROUTER else f"{role}.{vehicle}"


def access_control(vehicles: Sequence[str]) -> dict[str, Any]:
    """Zenoh's ``access_control`` section for these vehicles; whatever it does not name is denied.

    Unencrypted links on the machine itself, over loopback or a Unix socket, may do everything:
    whoever is there needs no network.
    """
    rules = [
        _rule(
            "this-machine",
            (*_PUBLISHER_MESSAGES, *_SUBSCRIBER_MESSAGES),
            ("ingress", "egress"),
            ("**",),
        )
    ]
    subjects: list[dict[str, Any]] = [
        {"id": "this-machine", "interfaces": ["lo"], "link_protocols": ["tcp"]},
        {"id": "this-service", "link_protocols": ["unixsock-stream"]},
    ]
    policies: list[dict[str, Any]] = [
        {"rules": ["this-machine"], "subjects": ["this-machine", "this-service"]}
    ]
    for vehicle in vehicles:
        for role in Role:
            access = role_access(role, Topics(vehicle))
            name = certificate_name(role, vehicle)
            own = _role_rules(name, access)
            if own:
                rules += own
                subjects.append({"id": name, "cert_common_names": [name]})
                policies.append({"rules": [rule["id"] for rule in own], "subjects": [name]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _role_rules(name: str, access: Access) -> list[dict[str, Any]]:
    """Rules of one role: what it publishes comes in, what it listens to goes out."""
    given, asked = _PUBLISHER_MESSAGES, _SUBSCRIBER_MESSAGES
    allowed = (
        ("publishes", given, "ingress", access.publishes),
        ("is subscribed to", asked, "egress", _of_any(access.publishes)),
        ("subscribes", asked, "ingress", _of_any(access.subscribes)),
        ("receives", given, "egress", access.subscribes),
    )
    denied = (
        ("never publishes", ("put", "delete"), "ingress", access.never_publishes),
        ("never subscribes", ("put", "delete"), "egress", access.never_subscribes),
    )
    return [
        {**_rule(f"{name} {verb}", messages, (flow,), keys), "permission": permission}
        for permission, lines in (("allow", allowed), ("deny", denied))
        for verb, messages, flow, keys in lines
        if keys
    ]


def _of_any(keys: Sequence[str]) -> tuple[str, ...]:
    """Keys as they are asked for, of one vehicle or of all; answers are of the own one alone."""
    of_all = ("/".join([first, "*", *rest]) for first, _, *rest in (k.split("/") for k in keys))
    return (*keys, *of_all)


def _rule(
    name: str, messages: Sequence[str], flows: Sequence[str], keys: Sequence[str]
) -> dict[str, Any]:
    # What is kept for late subscribers is asked for under @adv, which no wildcard covers.
    kept = [f"{key}/@adv/**" for key in keys if key != "**"]
    return {
        "id": name,
        "permission": "allow",
        "messages": list(messages),
        "flows": list(flows),
        "key_exprs": [*keys, *(kept or ["@/**", "**/@adv/**"])],
    }
