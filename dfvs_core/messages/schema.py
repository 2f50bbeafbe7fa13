"""Strict conversion between mappings (JSON, TOML) and frozen dataclasses.

An error names the place: of an unknown or missing key, a wrong type, a number that is not finite or
out of the field's range. For an unknown key it also names the nearest known one.

A name contains its unit. A settings file has ``_deg``, ``_deg_s`` and ``_deg_s2`` where a dataclass
has ``_rad``, ``_rad_s`` and ``_rad_s2``: value, range and error messages are in degrees there.
"""

import dataclasses
import difflib
import enum
import functools
import json
import math
import re
import types
import typing
from collections.abc import Mapping
from typing import Any, TypeVar

from dfvs_core.errors import ConfigError, WireError

T = TypeVar("T")

_RAD = re.compile(r"_rad(?=$|_s$|_s2$)")


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


def spelled(name: str) -> str:
    """Name of a field in a settings file."""
    return _RAD.sub("_deg", name)


def _degrees(value: Any) -> Any:
    # Twelve digits: 20 degrees must read 20, not 20.000000000000004.
    return value if value is None else float(f"{math.degrees(value):.12g}")


def in_degrees(data: Mapping[str, Any]) -> dict[str, Any]:
    """Dumped settings as a settings file has them."""
    return {
        spelled(name): in_degrees(value)
        if isinstance(value, Mapping)
        else (_degrees(value) if _RAD.search(name) else value)
        for name, value in data.items()
    }


def limits(field: dataclasses.Field[Any], *, file: bool) -> tuple[float | None, float | None]:
    """Smallest and largest value of a field, None where there is no limit."""
    low, high = field.metadata.get("low"), field.metadata.get("high")
    return (_degrees(low), _degrees(high)) if file and _RAD.search(field.name) else (low, high)


def range_text(low: float | None, high: float | None) -> str:
    """Range in words."""
    if low is None or high is None:
        return f"{high:g} or less" if low is None else f"{low:g} or more"
    return f"{low:g} to {high:g}"


def section_of(hint: Any) -> type[Any] | None:
    """Dataclass in a type hint ``X`` or ``X | None``, None where there is none."""
    for option in typing.get_args(hint) or (hint,):
        if dataclasses.is_dataclass(option) and isinstance(option, type):
            return option
    return None


def choices_of(hint: Any) -> tuple[Any, ...]:
    """Values of a Literal or an enumeration; of any other type none."""
    if isinstance(hint, type) and issubclass(hint, enum.Enum):
        return tuple(member.value for member in hint)
    return typing.get_args(hint) if typing.get_origin(hint) is typing.Literal else ()


def parse(cls: type[T], data: object, where: str = "", *, file: bool = False) -> T:
    """Build the dataclass ``cls`` from a mapping, with ``file`` from that of a settings file.

    Raises
    ------
    ConfigError
        With the place, the value and what was expected.
    """
    if not isinstance(data, Mapping):
        raise ConfigError(f"{where or 'the document'} is {data!r}", "a table of keys and values")
    spell = spelled if file else str
    fields = {spell(f.name): f for f in dataclasses.fields(cls)}  # type: ignore[arg-type]
    for key in data:
        if key not in fields:
            near = [n for n, f in fields.items() if f.metadata.get("formerly") == key]
            near = near or difflib.get_close_matches(str(key), fields, n=1, cutoff=0.0)
            raise ConfigError(
                f"unknown key {_join(where, str(key))!r}",
                f"one of {', '.join(sorted(fields))}",
                f"did you mean {near[0]!r}?" if near else "",
            )
    hints = hints_of(cls)  # type: ignore[arg-type]
    values: dict[str, Any] = {}
    for key, field in fields.items():
        place, hint = _join(where, key), hints[field.name]
        if key in data:
            value = _convert(hint, data[key], place, file)
            _check_range(value, *limits(field, file=file), place)
            is_angle = key != field.name and value is not None
            values[field.name] = math.radians(value) if is_angle else value
        elif field.default is field.default_factory is dataclasses.MISSING:
            raise ConfigError(f"{place!r} is missing", f"a value for it ({_title(hint)})")
    return cls(**values)


def with_present_names(cls: Any, data: Any) -> Any:
    """Recorded mapping with the present names of its fields in place of former ones."""
    if not isinstance(data, Mapping):
        return data
    fields = dataclasses.fields(cls)
    present: dict[Any, str] = {
        f.metadata["formerly"]: f.name for f in fields if f.metadata.get("formerly")
    }
    sections: dict[Any, type[Any] | None] = {
        name: section_of(hint) for name, hint in hints_of(cls).items()
    }
    renamed: dict[Any, Any] = {present.get(key, key): value for key, value in data.items()}
    return {
        key: value if (section := sections.get(key)) is None else with_present_names(section, value)
        for key, value in renamed.items()
    }


def from_json(cls: type[T], data: bytes, *, ignore_unknown: bool = False) -> T:
    """Message of the given class from its JSON, with ``ignore_unknown`` despite other keys.

    Raises
    ------
    WireError
        If it is not JSON or does not follow the schema (NaN included).
    """
    try:
        document = json.loads(data)
        if ignore_unknown and isinstance(document, Mapping):
            known = {f.name for f in dataclasses.fields(cls)}  # type: ignore[arg-type]
            document = {key: document[key] for key in known & document.keys()}
        return parse(cls, document)
    except (ValueError, RecursionError, ConfigError) as error:
        raise WireError(f"not a {cls.__name__}: {error}") from error


def rebuild(hint: Any, value: Any) -> Any:
    """Value of a type from what :func:`dump` made of it, unchecked: NaN and infinity pass.

    Raises
    ------
    ValueError, TypeError, KeyError
        If it does not follow the type.
    """
    if typing.get_origin(hint) is tuple:
        return tuple(rebuild(typing.get_args(hint)[0], v) for v in value)
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        hints = hints_of(hint)
        return hint(**{name: rebuild(h, value[name]) for name, h in hints.items() if name in value})
    return hint(value) if isinstance(hint, enum.EnumType) else value


def dump(value: object) -> Any:
    """Take a dataclass (or anything inside one) to what JSON and TOML can hold."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: dump(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, enum.Enum):
        return value.value
    if isinstance(value, Mapping):
        return {str(k): dump(v) for k, v in value.items()}
    if isinstance(value, tuple | list):
        return [dump(v) for v in value]
    return value


def to_json(value: object) -> bytes:
    """JSON of a message, from which :func:`from_json` makes an equal one."""
    return json.dumps(dump(value), separators=(",", ":")).encode()


def to_text(value: object) -> str:
    """JSON of a dataclass in indented lines, for files."""
    return json.dumps(dump(value), indent=2) + "\n"


@functools.cache
def hints_of(cls: type) -> dict[str, Any]:
    """Types of a dataclass' fields: working them out takes longer than all the rest."""
    return typing.get_type_hints(cls)


def _join(where: str, key: str) -> str:
    return f"{where}.{key}" if where else key


_TITLES = {float: "a number", int: "a whole number", str: "a text", bool: "true or false"}


def _title(hint: Any) -> str:
    return _TITLES[hint] if hint in _TITLES else getattr(hint, "__name__", str(hint))


def _check_range(value: object, low: float | None, high: float | None, where: str) -> None:
    if isinstance(value, int | float) and not (
        (low is None or low <= value) and (high is None or value <= high)
    ):
        raise ConfigError(f"{where} = {value!r} is out of range", range_text(low, high))


def _convert(hint: Any, value: object, where: str, file: bool) -> Any:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (types.UnionType, typing.Union):
        (option,) = [o for o in arguments if o is not type(None)]
        return None if value is None else _convert(option, value, where, file)
    if origin is tuple:
        return _convert_tuple(arguments, value, where, file)
    if origin is dict:
        if not isinstance(value, Mapping):
            raise ConfigError(f"{where} = {value!r}", "a table")
        return {
            str(k): _convert(arguments[1], v, _join(where, str(k)), file) for k, v in value.items()
        }
    if choices := choices_of(hint):
        _check_choice(choices, value, where)
        return value if origin is typing.Literal else hint(value)
    if section := section_of(hint):
        return parse(section, value, where, file=file)
    return _convert_scalar(hint, value, where)


def _convert_tuple(
    items: tuple[Any, ...], value: object, where: str, file: bool
) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise ConfigError(f"{where} = {value!r}", "a list")
    if items[-1] is Ellipsis:
        items = items[:1] * len(value)
    if len(value) != len(items):
        raise ConfigError(f"{where} has {len(value)} values", f"{len(items)}")
    pairs = enumerate(zip(items, value, strict=True))
    return tuple(_convert(hint, v, f"{where}[{i}]", file) for i, (hint, v) in pairs)


def _check_choice(choices: tuple[Any, ...], value: object, where: str) -> None:
    if value not in choices:
        listed = ", ".join(repr(c) for c in choices)
        near = difflib.get_close_matches(str(value), [str(c) for c in choices], n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}?" if near else ""
        raise ConfigError(f"{where} = {value!r}", f"one of {listed}", hint)


def _convert_scalar(hint: Any, value: object, where: str) -> Any:
    if hint is float and isinstance(value, int | float) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError as error:
            raise ConfigError(f"{where} is too large", "a finite number") from error
        if not math.isfinite(number):
            raise ConfigError(f"{where} = {value!r}", "a finite number")
        return number
    if hint is Any or (isinstance(value, hint) and not (hint is int and isinstance(value, bool))):
        return value
    raise ConfigError(f"{where} = {value!r}", _title(hint))
