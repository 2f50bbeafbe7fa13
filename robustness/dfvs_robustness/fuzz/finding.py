"""Violations of invariants, the episodes that lead to them, and JSON files of these."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from dfvs_core.errors import ConfigError

E = TypeVar("E")


class InvariantError(Exception):
    """An invariant, named by its rule (such as I1), does not hold; the text says what was seen."""

    def __init__(self, rule: str, text: str) -> None:
        self.rule = rule
        self.text = text
        super().__init__(f"{rule}: {text}")


@dataclass(frozen=True, slots=True)
class Finding(Generic[E]):
    """An episode that ended in a violation."""

    episode: E
    rule: str
    text: str


@dataclass(frozen=True, slots=True)
class ReplayFormat(Generic[E]):
    """Files of findings, from which their episodes are replayed."""

    name: str
    """Name of the format, in every file."""
    dump: Callable[[E], dict[str, Any]]
    """Takes an episode to what JSON can hold."""
    build: Callable[[dict[str, Any]], E]
    """Makes an episode of that again."""

    def write(self, finding: Finding[E], path: Path) -> None:
        """Write a finding; NaN and infinity are kept, as Python's JSON knows them.

        Raises ConfigError if the file cannot be written.
        """
        head = {"format": self.name, "rule": finding.rule, "text": finding.text}
        text = json.dumps(head | self.dump(finding.episode), indent=1) + "\n"
        try:
            path.write_text(text, encoding="utf-8")
        except OSError as error:
            raise ConfigError(
                f"cannot write {path} ({error.strerror})", "a writable folder"
            ) from error

    def read(self, path: Path) -> E:
        """Episode of a finding; ConfigError if the file cannot be read or is not of this format."""
        try:
            document = json.loads(path.read_text(encoding="utf-8"))
            if document["format"] != self.name:
                raise ConfigError(f"{path} has format {document['format']!r}", repr(self.name))
            return self.build(document)
        except OSError as error:
            raise ConfigError(f"cannot read {path} ({error.strerror})", "a replay file") from error
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise ConfigError(f"{path} is no replay ({error!r})", repr(self.name)) from error
