"""Conditions under which a replay is bit-exact."""

from collections.abc import Mapping
from typing import Any

from dfvs_core.messages.frame_record import SessionHeader
from dfvs_core.messages.schema import dump, with_present_names
from dfvs_service.settings.config import ServiceConfig

_SHOWN_CHARACTERS = 24


def reasons_to_differ(
    header: SessionHeader, config: ServiceConfig, model: Mapping[str, str], build: Mapping[str, str]
) -> tuple[str, ...]:
    """In which ways this replay is not the flight; empty: every bit must be the same.

    ``header`` is of the flight; settings, files of the networks with their SHA-256, and versions
    are of the replay.
    """
    reasons = [
        f"{name} is {_short(build.get(name))}, was {_short(header.build.get(name))}"
        for name in sorted({*build, *header.build})
        if build.get(name) != header.build.get(name)
    ]
    for name, is_depth in (("model", False), ("depth network", True)):
        if _files(model, is_depth) != _files(header.model, is_depth):
            reasons.append(f"the {name}'s files are others")
    now, then = (
        _relevant(dump(config)),
        _relevant(with_present_names(ServiceConfig, header.settings)),
    )
    reasons += [f"the settings of [{name}] are others" for name in now if now[name] != then[name]]
    return tuple(reasons)


def _files(model: Mapping[str, str], is_depth: bool) -> dict[str, str]:
    """Files of the depth network, or of the matcher."""
    return {k: v for k, v in model.items() if k.startswith("depth/") == is_depth}


def _short(version: str | None) -> str:
    return "none" if version is None else version[:_SHOWN_CHARACTERS]


def _relevant(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Sections that perception works by; of a model only how it is used, not where it lies."""
    flow = dict(settings["flow"])
    flow["model"] = flow["model"].partition(":")[0] if ":" in flow["model"] else ""
    return {"camera": settings["camera"], "servo": settings["servo"], "flow": flow}
