"""Findings of the command ingress as JSON files; bytes are hexadecimal."""

from typing import Any

from dfvs_robustness.fuzz.commands.ingress import CommandEpisode, Sending
from dfvs_robustness.fuzz.finding import ReplayFormat


def _dump(episode: CommandEpisode) -> dict[str, Any]:
    sendings = [
        [s.t_ns, s.command.hex(), None if s.goal is None else s.goal.hex(), s.kind]
        for s in episode.sendings
    ]
    return {"born_ns": episode.born_ns, "sendings": sendings}


def _episode(document: dict[str, Any]) -> CommandEpisode:
    sendings = [
        Sending(
            int(t_ns),
            bytes.fromhex(command),
            None if goal is None else bytes.fromhex(goal),
            str(kind),
        )
        for t_ns, command, goal, kind in document["sendings"]
    ]
    return CommandEpisode(int(document["born_ns"]), sendings)


REPLAY = ReplayFormat("dfvs-command-replay/1", _dump, _episode)
