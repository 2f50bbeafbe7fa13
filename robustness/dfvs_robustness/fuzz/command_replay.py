"""Findings of the command ingress as JSON files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dfvs_robustness.fuzz.command_fuzz import CommandFinding
from dfvs_robustness.fuzz.command_ingress import CommandEpisode, Sending
from dfvs_robustness.fuzz.replay_file import read_document, write_document

REPLAY_FORMAT = "dfvs-command-replay/1"


def write_finding(finding: CommandFinding, path: Path) -> None:
    """Write a finding so that ``read_episode`` gives its episode back; bytes are hexadecimal.

    Raises
    ------
    ConfigError
        If the file cannot be written.
    """
    document = {
        "format": REPLAY_FORMAT,
        "rule": finding.rule,
        "text": finding.text,
        "born_ns": finding.episode.born_ns,
        "sendings": [
            [s.t_ns, s.command.hex(), None if s.goal is None else s.goal.hex(), s.kind]
            for s in finding.episode.sendings
        ],
    }
    write_document(path, document)


def read_episode(path: Path) -> CommandEpisode:
    """Read the episode of a finding.

    Raises
    ------
    ConfigError
        If the file cannot be read or is not of that format.
    """
    return read_document(path, REPLAY_FORMAT, _episode)


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
