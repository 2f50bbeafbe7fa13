"""JSON files of findings, to be replayed."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from dfvs_core.errors import ConfigError

T = TypeVar("T")


def write_document(path: Path, document: dict[str, Any]) -> None:
    """Write a finding; NaN and infinity are kept, as Python's JSON knows them.

    Raises
    ------
    ConfigError
        If the file cannot be written.
    """
    try:
        path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"cannot write {path} ({error.strerror})", "a writable folder") from error


def read_document(path: Path, expected: str, build: Callable[[dict[str, Any]], T]) -> T:
    """Episode that ``build`` makes of a finding with the ``expected`` format.

    Raises
    ------
    ConfigError
        If the file cannot be read or is not of that format.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        if document["format"] != expected:
            raise ConfigError(f"{path} has format {document['format']!r}", repr(expected))
        return build(document)
    except OSError as error:
        raise ConfigError(f"cannot read {path} ({error.strerror})", "a replay file") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ConfigError(f"{path} is no replay ({error!r})", repr(expected)) from error
