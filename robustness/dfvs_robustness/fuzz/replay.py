"""Findings of the gate as JSON files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dfvs_core.gate import events as gate_events
from dfvs_core.gate.config import GateConfig
from dfvs_core.gate.events import Event
from dfvs_core.messages.schema import dump, rebuild
from dfvs_robustness.fuzz.episode import Episode
from dfvs_robustness.fuzz.gate_fuzz import Finding
from dfvs_robustness.fuzz.replay_file import read_document, write_document

REPLAY_FORMAT = "dfvs-gate-replay/1"


def write_finding(finding: Finding, path: Path) -> None:
    """Write a finding so that ``read_episode`` gives its episode back.

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
    write_document(path, document)


def read_episode(path: Path) -> Episode:
    """Read the episode of a finding.

    Raises
    ------
    ConfigError
        If the file cannot be read or is not of that format.
    """
    return read_document(path, REPLAY_FORMAT, _episode)


def _dump_event(event: Event) -> dict[str, Any]:
    return {"event": type(event).__name__, **dump(event)}


def _load_event(data: dict[str, Any]) -> Event:
    fields = dict(data)
    event: Event = rebuild(getattr(gate_events, fields.pop("event")), fields)
    return event


def _episode(document: dict[str, Any]) -> Episode:
    steps = [(int(t_ns), tuple(map(_load_event, some))) for t_ns, some in document["steps"]]
    return Episode(rebuild(GateConfig, document["config"]), int(document["born_ns"]), steps)
