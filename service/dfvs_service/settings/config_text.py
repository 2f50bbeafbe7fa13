"""Settings as commented TOML and as a table, angles in degrees."""

import dataclasses
import json
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from dfvs_core.messages.schema import (
    choices_of,
    dump,
    hints_of,
    in_degrees,
    limits,
    range_text,
    section_of,
    spelled,
)
from dfvs_service.settings.config import ServiceConfig

_WIDTH = 92
_HEADING = """\
# Settings of dfvs-service, as printed by: dfvs-service config
# What is commented out is not set. Angles are in degrees.

"""


@dataclass(frozen=True, slots=True)
class _Entry:
    """One setting: ``value`` is TOML, None where it is not set."""

    section: str
    is_section_set: bool
    name: str
    meaning: str
    span: str
    choices: tuple[str, ...]
    value: str | None


def toml_text(config: ServiceConfig) -> str:
    """TOML of the settings, every key with what it means; unset ones are commented out."""
    return _HEADING + "\n".join(
        _section(*key, entries)
        for key, entries in groupby(_all(config), lambda e: (e.section, e.is_section_set))
    )


def markdown_table(config: ServiceConfig) -> str:
    """Markdown table of the settings: name, value, allowed values, meaning."""
    rows = ["| setting | value | allowed | meaning |", "|---|---|---|---|"]
    for entry in _all(config):
        value = "" if entry.value is None else f"`{entry.value}`"
        allowed = entry.span or ", ".join(f"`{choice}`" for choice in entry.choices)
        cells = (f"`{entry.section}.{entry.name}`", value, allowed, entry.meaning)
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(rows) + "\n"


def _all(config: ServiceConfig) -> Iterator[_Entry]:
    values = in_degrees(dump(config))
    for name, hint in hints_of(ServiceConfig).items():
        yield from _entries(name, section_of(hint), values[name])


def _entries(path: str, cls: Any, values: Mapping[str, Any] | None) -> Iterator[_Entry]:
    """Settings of a section, then those of its own sections; without values it is not set."""
    inner = []
    for field in dataclasses.fields(cls):
        name, hint = spelled(field.name), hints_of(cls)[field.name]
        value = None if values is None else values[name]
        if section := section_of(hint):
            inner.append((f"{path}.{name}", section, value))
            continue
        low, high = limits(field, file=True)
        yield _Entry(
            path,
            values is not None,
            name,
            field.metadata.get("help", ""),
            "" if low is high is None else range_text(low, high),
            tuple(map(str, choices_of(hint))),
            # JSON's strings, numbers, booleans and lists of them are TOML as well.
            None if value is None else json.dumps(value, ensure_ascii=False),
        )
    for each in inner:
        yield from _entries(*each)


def _section(path: str, is_set: bool, entries: Iterator[_Entry]) -> str:
    lines = [f"[{path}]" if is_set else f"# [{path}]"]
    for entry in entries:
        meaning = f"{entry.meaning} ({entry.span})".strip() if entry.span else entry.meaning
        lines += [f"# {line}" for line in textwrap.wrap(meaning, _WIDTH)]
        unset = entry.value is None
        lines.append(f"# {entry.name} =" if unset else f"{entry.name} = {entry.value}")
    return "\n".join(lines) + "\n"
