"""What the benchmark keeps on disk between runs: JSON documents of dataclasses."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from dfvs_common.atomic_file import write_atomic
from dfvs_core.errors import ConfigError
from dfvs_core.messages.schema import parse

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

_T = TypeVar("_T")


def read_document(kind: type[_T], path: Path, subject: str, expected: str) -> _T:
    """Read a document and check it against its dataclass, ``kind``.

    ``subject`` and ``expected`` say in the error what the file is and should be.

    Raises
    ------
    ConfigError
        If it cannot be read, or is something else.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ConfigError(f"{subject} cannot be read ({error})", expected) from error
    return parse(kind, data, path.name)


def write_document(path: Path, document: DataclassInstance) -> None:
    """Write a document, whole or not at all."""
    write_atomic(path, (json.dumps(asdict(document)) + "\n").encode())
