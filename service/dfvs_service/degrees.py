"""Settings files speak degrees, the program speaks radians.

``degrees_view`` derives from a settings dataclass the one that its TOML follows. A field whose name
ends in ``_rad``, ``_rad_s`` or ``_rad_s2`` is spelled ``_deg...`` there, with default and range in
degrees. So error messages and the printed defaults are in degrees too.
"""

from __future__ import annotations

import dataclasses
import math
import re
import types
import typing
from typing import Any, TypeVar

T = TypeVar("T")

_RAD = re.compile(r"_rad(?=$|_s$|_s2$)")


def spelled(name: str) -> str:
    """Name of a field in a settings file."""
    return _RAD.sub("_deg", name)


def _is_angle(name: str) -> bool:
    return spelled(name) != name


def _degrees(value: Any) -> Any:
    # Twelve digits: 20 degrees must read 20, not 20.000000000000004.
    return float(f"{math.degrees(value):.12g}") if isinstance(value, int | float) else value


def degrees_view(cls: type[Any]) -> type[Any]:
    """Dataclass like ``cls``, with angles in degrees, also inside its sections."""
    hints = typing.get_type_hints(cls)
    fields = [_view_field(f, hints[f.name]) for f in dataclasses.fields(cls)]
    return dataclasses.make_dataclass(cls.__name__, fields, frozen=True, slots=True, kw_only=True)


def _view_field(field: dataclasses.Field[Any], hint: Any) -> tuple[str, Any, Any]:
    if _is_angle(field.name):
        metadata = {
            key: _degrees(value) if key in ("low", "high") else value
            for key, value in field.metadata.items()
        }
        default = _degrees(field.default)
        return spelled(field.name), hint, dataclasses.field(default=default, metadata=metadata)
    section = section_of(hint)
    if section is None:
        return field.name, hint, _copied(field)
    view = degrees_view(section)
    optional = section is not hint
    made: Any = dataclasses.field(default=None) if optional else None
    made = made if optional else dataclasses.field(default_factory=view)
    return field.name, (view | None if optional else view), made


def _copied(field: dataclasses.Field[Any]) -> Any:
    if field.default is not dataclasses.MISSING:
        return dataclasses.field(default=field.default, metadata=field.metadata)
    if field.default_factory is not dataclasses.MISSING:
        return dataclasses.field(default_factory=field.default_factory, metadata=field.metadata)
    return dataclasses.field(metadata=field.metadata)


def section_of(hint: Any) -> type[Any] | None:
    """Dataclass in a type hint ``X`` or ``X | None``, None where there is none."""
    options = typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
    for option in options:
        if dataclasses.is_dataclass(option) and isinstance(option, type):
            return option
    return None


def to_radians(cls: type[T], view: Any) -> T:
    """Build the dataclass ``cls`` from its view in degrees."""
    hints = typing.get_type_hints(cls)
    values: dict[str, Any] = {}
    for field in dataclasses.fields(cls):  # type: ignore[arg-type]
        value = getattr(view, spelled(field.name))
        section = section_of(hints[field.name])
        if value is not None and section is not None:
            value = to_radians(section, value)
        elif value is not None and _is_angle(field.name):
            value = math.radians(value)
        values[field.name] = value
    return cls(**values)


def to_degrees(config: Any) -> Any:
    """Take a settings dataclass to its view in degrees."""
    hints = typing.get_type_hints(type(config))
    values: dict[str, Any] = {}
    for field in dataclasses.fields(config):
        value = getattr(config, field.name)
        if value is not None and section_of(hints[field.name]) is not None:
            value = to_degrees(value)
        elif value is not None and _is_angle(field.name):
            value = _degrees(value)
        values[spelled(field.name)] = value
    return degrees_view(type(config))(**values)
