"""Plain mappings (from JSON or TOML) to frozen dataclasses and back, strictly.

An error names the place: of an unknown or missing key, a wrong type, a number that is not finite or
out of the field's range. For an unknown key it also names the nearest known one.
"""

from __future__ import annotations

import dataclasses
import difflib
import enum
import functools
import math
import types
import typing
from collections.abc import Mapping
from typing import Any, TypeVar

from dfvs_core.errors import ConfigError

T = TypeVar("T")


def setting(
    default: Any,
    help_text: str,
    *,
    low: float | None = None,
    high: float | None = None,
    formerly: str = "",
) -> Any:
    """Dataclass field with a default, a help text and a closed range for numbers.

    ``formerly`` is a name that the field no longer has: it is refused with the present one.
    """
    metadata = {"help": help_text, "low": low, "high": high, "formerly": formerly}
    return dataclasses.field(default=default, metadata=metadata)


def parse(cls: type[T], data: object, where: str = "") -> T:
    """Build the dataclass ``cls`` from a mapping.

    Raises
    ------
    ConfigError
        With the place, the value and what was expected.
    """
    if not isinstance(data, Mapping):
        raise ConfigError(f"{where or 'the document'} is {data!r}", "a table of keys and values")
    fields = {f.name: f for f in dataclasses.fields(cls) if f.init}  # type: ignore[arg-type]
    hints = _hints(cls)  # type: ignore[arg-type]
    for key in data:
        if key not in fields:
            near = [n for n, f in fields.items() if f.metadata.get("formerly") == key]
            near = near or difflib.get_close_matches(str(key), fields, n=1, cutoff=0.0)
            raise ConfigError(
                f"unknown key {_join(where, str(key))!r}",
                f"one of {', '.join(sorted(fields))}",
                f"did you mean {near[0]!r}?" if near else "",
            )
    values: dict[str, Any] = {}
    for name, field in fields.items():
        place = _join(where, name)
        if name in data:
            values[name] = _convert(hints[name], data[name], place)
            _check_range(values[name], field.metadata, place)
        elif _is_required(field):
            raise ConfigError(f"{place!r} is missing", f"a value for it ({_title(hints[name])})")
    return cls(**values)


def dump(value: object) -> Any:
    """Take a dataclass (or anything inside one) to what JSON and TOML can hold."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: dump(getattr(value, f.name)) for f in dataclasses.fields(value) if f.init}
    if isinstance(value, enum.Enum):
        return value.value
    if isinstance(value, Mapping):
        return {str(k): dump(v) for k, v in value.items()}
    if isinstance(value, tuple | list):
        return [dump(v) for v in value]
    return value


@functools.cache
def _hints(cls: type) -> dict[str, Any]:
    """Types of a dataclass' fields: working them out takes longer than all the rest."""
    return typing.get_type_hints(cls)


def _join(where: str, key: str) -> str:
    return f"{where}.{key}" if where else key


def _title(hint: Any) -> str:
    return getattr(hint, "__name__", str(hint))


def _is_required(field: dataclasses.Field[Any]) -> bool:
    missing = dataclasses.MISSING
    return field.default is missing and field.default_factory is missing


def _check_range(value: object, metadata: Mapping[str, Any], where: str) -> None:
    low, high = metadata.get("low"), metadata.get("high")
    numbers = value if isinstance(value, tuple) else (value,)
    for number in numbers:
        if not isinstance(number, int | float) or isinstance(number, bool):
            continue
        if (low is not None and number < low) or (high is not None and number > high):
            least = "-inf" if low is None else f"{low:g}"
            most = "inf" if high is None else f"{high:g}"
            raise ConfigError(f"{where} = {number!r} is out of range", f"{least} to {most}")


def _convert(hint: Any, value: object, where: str) -> Any:
    origin = typing.get_origin(hint)
    if origin in (types.UnionType, typing.Union):
        return _convert_union(typing.get_args(hint), value, where)
    if origin is tuple:
        return _convert_tuple(typing.get_args(hint), value, where)
    if origin is dict:
        return _convert_dict(typing.get_args(hint), value, where)
    if origin is typing.Literal:
        return _convert_choice(typing.get_args(hint), value, where)
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        return parse(hint, value, where)
    if isinstance(hint, type) and issubclass(hint, enum.Enum):
        return hint(_convert_choice(tuple(m.value for m in hint), value, where))
    return _convert_scalar(hint, value, where)


def _convert_union(options: tuple[Any, ...], value: object, where: str) -> Any:
    if value is None and type(None) in options:
        return None
    (hint,) = [o for o in options if o is not type(None)]
    return _convert(hint, value, where)


def _convert_tuple(items: tuple[Any, ...], value: object, where: str) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise ConfigError(f"{where} = {value!r}", "a list")
    if len(items) == 2 and items[1] is Ellipsis:
        return tuple(_convert(items[0], v, f"{where}[{i}]") for i, v in enumerate(value))
    if len(value) != len(items):
        raise ConfigError(f"{where} has {len(value)} values", f"{len(items)}")
    pairs = zip(items, value, strict=True)
    return tuple(_convert(h, v, f"{where}[{i}]") for i, (h, v) in enumerate(pairs))


def _convert_dict(items: tuple[Any, ...], value: object, where: str) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise ConfigError(f"{where} = {value!r}", "a table")
    return {str(k): _convert(items[1], v, _join(where, str(k))) for k, v in value.items()}


def _convert_choice(choices: tuple[Any, ...], value: object, where: str) -> Any:
    if value not in choices:
        listed = ", ".join(repr(c) for c in choices)
        near = difflib.get_close_matches(str(value), [str(c) for c in choices], n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}?" if near else ""
        raise ConfigError(f"{where} = {value!r}", f"one of {listed}", hint)
    return value


def _convert_scalar(hint: Any, value: object, where: str) -> Any:
    if hint is float and isinstance(value, int | float) and not isinstance(value, bool):
        if not math.isfinite(value):
            raise ConfigError(f"{where} = {value!r}", "a finite number")
        return float(value)
    if hint is Any or (isinstance(value, hint) and not (hint is int and isinstance(value, bool))):
        return value
    raise ConfigError(f"{where} = {value!r} is {type(value).__name__}", _title(hint))
