"""Settings as commented TOML, angles in degrees: what a user starts from."""

from __future__ import annotations

import dataclasses
import json
import textwrap
import typing
from typing import Any

from dfvs_core.schema import dump
from dfvs_service.config import ServiceConfig
from dfvs_service.degrees import degrees_view, section_of, to_degrees

_WIDTH = 92
_HEADING = """\
# Settings of dfvs-service, as printed by: dfvs-service config
# What is commented out is not set. Angles are in degrees.
"""


def toml_text(config: ServiceConfig) -> str:
    """TOML of the settings, every key with what it means; unset ones are commented out."""
    view_class = degrees_view(ServiceConfig)
    view = to_degrees(config)
    parts = [
        _section(field.name, getattr(view, field.name), typing.get_type_hints(view_class))
        for field in dataclasses.fields(view_class)
    ]
    return "\n".join([_HEADING, *parts])


def _section(path: str, section: Any, hints: dict[str, Any]) -> str:
    cls = section_of(hints[path.split(".")[-1]])
    if cls is None:
        raise TypeError(f"{path} is not a section")
    inner_hints = typing.get_type_hints(cls)
    lines, tables = [f"[{path}]"], []
    for field in dataclasses.fields(cls):
        value = None if section is None else getattr(section, field.name)
        if section_of(inner_hints[field.name]) is None:
            lines += _entry(field, value)
        else:
            tables.append(_section(f"{path}.{field.name}", value, inner_hints))
    text = "\n".join(lines) + "\n"
    if section is None:  # an optional section that is not set
        text = textwrap.indent(text, "# ", lambda line: not line.startswith("#"))
    return "\n".join([text, *tables])


def _entry(field: dataclasses.Field[Any], value: object) -> list[str]:
    meaning = field.metadata.get("help", "")
    low, high = field.metadata.get("low"), field.metadata.get("high")
    if low is not None or high is not None:
        least = "-inf" if low is None else f"{low:.4g}"
        most = "inf" if high is None else f"{high:.4g}"
        meaning = f"{meaning} ({least} to {most})".strip()
    lines = [f"# {line}" for line in textwrap.wrap(meaning, _WIDTH)]
    if value is None:
        return [*lines, f"# {field.name} ="]
    return [*lines, f"{field.name} = {_value(value)}"]


def _value(value: object) -> str:
    # JSON's strings, numbers, booleans and lists of them are TOML as well.
    return json.dumps(dump(value), ensure_ascii=False)
