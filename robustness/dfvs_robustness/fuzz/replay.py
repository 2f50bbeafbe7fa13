"""A life of the gate as a JSON file, to be lived again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from dfvs_core.errors import ConfigError
from dfvs_core.gate import events as gate_events
from dfvs_core.gate.config import GateConfig
from dfvs_core.gate.events import Event
from dfvs_core.messages.schema import dump, rebuild
from dfvs_robustness.fuzz.episode import Episode
from dfvs_robustness.fuzz.gate_fuzz import Finding

REPLAY_FORMAT = "dfvs-gate-replay/1"


def write_finding(finding: Finding, path: Path) -> None:
    """Write a finding so that ``read_episode`` gives its life back.

    Raises
    ------
    ConfigError
        If the file cannot be written.
    """
    episode = finding.episode
    document = {
        "format": REPLAY_FORMAT,
        "rule": finding.rule,
        "text": finding.text,
        "config": dump(episode.config),
        "born_ns": episode.born_ns,
        "steps": [[t_ns, [_dump_event(e) for e in events]] for t_ns, events in episode.steps],
    }
    try:
        # NaN and Infinity are what a gate must bear: Python's JSON knows both.
        path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"cannot write {path} ({error.strerror})", "a writable folder") from error


def read_episode(path: Path) -> Episode:
    """Read the life of a finding.

    Raises
    ------
    ConfigError
        If the file cannot be read or is not of that format.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        if document["format"] != REPLAY_FORMAT:
            raise ConfigError(f"{path} has format {document['format']!r}", repr(REPLAY_FORMAT))
        steps = [(int(t_ns), tuple(map(_load_event, some))) for t_ns, some in document["steps"]]
        return Episode(rebuild(GateConfig, document["config"]), int(document["born_ns"]), steps)
    except OSError as error:
        raise ConfigError(f"cannot read {path} ({error.strerror})", "a replay file") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ConfigError(f"{path} is no replay ({error!r})", repr(REPLAY_FORMAT)) from error


def _dump_event(event: Event) -> dict[str, Any]:
    return {"event": type(event).__name__, **dump(event)}


def _load_event(data: dict[str, Any]) -> Event:
    fields = dict(data)
    event: Event = rebuild(getattr(gate_events, fields.pop("event")), fields)
    return event
