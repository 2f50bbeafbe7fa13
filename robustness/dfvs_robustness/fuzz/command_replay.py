"""A life of the command ingress as a JSON file, to be lived again."""

from __future__ import annotations

import json
from pathlib import Path

from dfvs_core.errors import ConfigError
from dfvs_robustness.fuzz.command_fuzz import CommandFinding
from dfvs_robustness.fuzz.command_ingress import CommandLife, Sending

REPLAY_FORMAT = "dfvs-command-replay/1"


def write_finding(finding: CommandFinding, path: Path) -> None:
    """Write a finding so that ``read_episode`` gives its life back; bytes are hexadecimal.

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
    try:
        path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"cannot write {path} ({error.strerror})", "a writable folder") from error


def read_episode(path: Path) -> CommandLife:
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
        sendings = [
            Sending(
                int(t_ns),
                bytes.fromhex(command),
                None if goal is None else bytes.fromhex(goal),
                str(kind),
            )
            for t_ns, command, goal, kind in document["sendings"]
        ]
        return CommandLife(int(document["born_ns"]), sendings)
    except OSError as error:
        raise ConfigError(f"cannot read {path} ({error.strerror})", "a replay file") from error
    except (ValueError, KeyError, TypeError) as error:
        raise ConfigError(f"{path} is no replay ({error!r})", repr(REPLAY_FORMAT)) from error
