"""Findings of the gate as JSON files."""

from typing import Any

from dfvs_core.gate.config import GateConfig
from dfvs_core.gate.events import Event
from dfvs_core.gate.replay import EVENT_KINDS
from dfvs_core.messages.schema import dump, rebuild, with_present_names
from dfvs_robustness.fuzz.finding import ReplayFormat
from dfvs_robustness.fuzz.gate.episode import Episode


def _dump(episode: Episode) -> dict[str, Any]:
    return {
        "config": dump(episode.config),
        "born_ns": episode.born_ns,
        "steps": [[t_ns, [_dump_event(e) for e in events]] for t_ns, events in episode.steps],
    }


def _dump_event(event: Event) -> dict[str, Any]:
    return {"event": type(event).__name__, **dump(event)}


def _load_event(data: dict[str, Any]) -> Event:
    event: Event = rebuild(EVENT_KINDS[data["event"]], data)
    return event


def _episode(document: dict[str, Any]) -> Episode:
    steps = [(int(t_ns), tuple(map(_load_event, some))) for t_ns, some in document["steps"]]
    config = rebuild(GateConfig, with_present_names(GateConfig, document["config"]))
    return Episode(config, int(document["born_ns"]), steps)


REPLAY = ReplayFormat("dfvs-gate-replay/1", _dump, _episode)
