"""Security check of ONNX files before loading.

ONNX is protocol buffers: a message is a run of (field number, wire type, value). Only the few
fields are followed that lead to nodes and tensors (onnx.proto); everything else is skipped.
"""

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from dfvs_core.errors import ModelError

STANDARD_DOMAINS = frozenset({"", "ai.onnx"})

_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
_MOST_DEEP = 32

# message -> field number -> message that the field holds
_PATHS: dict[str, dict[int, str]] = {
    "model": {7: "graph", 25: "function"},
    "function": {7: "node"},
    "graph": {1: "node", 5: "tensor", 15: "sparse"},
    "node": {5: "attribute"},
    "attribute": {5: "tensor", 6: "graph", 10: "tensor", 11: "graph", 22: "sparse", 23: "sparse"},
    "sparse": {1: "tensor", 2: "tensor"},
}
_NODE_OPERATOR, _NODE_DOMAIN = 4, 7
_ATTRIBUTE_FLOATS = (2, 7)
_TENSOR_TYPE, _TENSOR_FLOATS, _TENSOR_INTEGERS, _TENSOR_RAW, _TENSOR_DOUBLES = 2, 4, 5, 9, 10
_TENSOR_EXTERNAL_DATA, _TENSOR_LOCATION = 13, 14
_FLOAT, _DOUBLE = "<f4", "<f8"
_HALF_TYPE = 10
_RAW_FLOATS = {1: _FLOAT, _HALF_TYPE: "<f2", 11: _DOUBLE}
"""What a tensor's raw bytes are, by its type."""
_MOST_FIELD = (1 << 29) - 1
"""Readers of protocol buffers cut longer numbers down: what looks unknown here is a field there."""


def check_onnx(data: bytes, name: str) -> None:
    """Refuse an ONNX file that needs more than itself and the standard operators.

    Weights are looked at here, since 8-bit graphs turn what is not a number into an integer.

    Raises
    ------
    ModelError
        If it cannot be read, keeps weights outside itself, uses operators that are not ONNX's
        own, or has weights that are not numbers.
    """
    try:
        _check_message(memoryview(data), "model", name, 0)
    except (IndexError, ValueError) as error:
        raise ModelError(f"{name!r} is not a readable ONNX file ({error})") from error


def _check_message(data: memoryview, kind: str, name: str, depth: int) -> None:
    if depth > _MOST_DEEP:
        raise ModelError(f"{name!r} nests graphs more than {_MOST_DEEP} deep")
    if kind == "tensor":
        _check_tensor(data, name)
        return
    if kind == "node":
        _check_operator(data, name)
    for number, value in _fields(data):
        if isinstance(value, int):
            continue
        if number in _PATHS[kind]:
            _check_message(value, _PATHS[kind][number], name, depth + 1)
        elif kind == "attribute" and number in _ATTRIBUTE_FLOATS:
            _check_numbers(value, _FLOAT, name)


def _check_operator(node: memoryview, name: str) -> None:
    told = (_NODE_OPERATOR, _NODE_DOMAIN)
    found = {number: _text(value) for number, value in _fields(node) if number in told}
    if found.get(_NODE_DOMAIN, "") not in STANDARD_DOMAINS:
        raise ModelError(
            f"{name!r} uses the operator {found.get(_NODE_OPERATOR, '')!r} of the domain"
            f" {found[_NODE_DOMAIN]!r}",
            "ONNX's own operators only",
        )


def _check_tensor(data: memoryview, name: str) -> None:
    """Refuse weights outside the file, and any that is not a number in whatever notation."""
    element = 0
    raw: list[memoryview] = []
    integers: list[Iterable[int]] = []
    for number, value in _fields(data):
        if number in (_TENSOR_EXTERNAL_DATA, _TENSOR_LOCATION) and value:
            raise ModelError(
                f"{name!r} keeps weights in another file", "all weights inside the ONNX file"
            )
        if isinstance(value, int):
            element = value if number == _TENSOR_TYPE else element
            integers += [[value]] if number == _TENSOR_INTEGERS else []
        elif number in (_TENSOR_FLOATS, _TENSOR_DOUBLES):
            _check_numbers(value, _FLOAT if number == _TENSOR_FLOATS else _DOUBLE, name)
        elif number == _TENSOR_INTEGERS:
            integers.append(_varints(value))
        elif number == _TENSOR_RAW:
            raw.append(value)
    if element == _HALF_TYPE:  # half floats may stand as whole numbers
        bits = [value & 0xFFFF for part in integers for value in part]
        raw.append(memoryview(np.array(bits, "<u2").tobytes()))
    for part in raw if element in _RAW_FLOATS else ():
        _check_numbers(part, _RAW_FLOATS[element], name)


def _varints(data: memoryview) -> Iterator[int]:
    """Packed whole numbers."""
    at = 0
    while at < len(data):
        value, at = _varint(data, at)
        yield value


def _check_numbers(data: memoryview, element: str, name: str) -> None:
    """Refuse what is not a number; infinity is one, and some networks mask with it."""
    numbers: NDArray[np.floating] = np.frombuffer(data, element)
    if np.isnan(numbers).any():
        raise ModelError(f"{name!r} has weights that are not numbers", "finite weights")


def _fields(data: memoryview) -> Iterator[tuple[int, memoryview | int]]:
    """Go through a message: field number and value, bytes for all but whole numbers."""
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        number, wire_type = key >> 3, key & 7
        if not 0 < number <= _MOST_FIELD:
            raise ValueError(f"field number {number} at byte {at}")
        if wire_type == _VARINT:
            value, at = _varint(data, at)
            yield number, value
            continue
        if wire_type == _BYTES:
            length, at = _varint(data, at)
        elif wire_type in (_FIXED32, _FIXED64):
            length = 4 if wire_type == _FIXED32 else 8
        else:
            raise ValueError(f"wire type {wire_type} at byte {at}")
        if at + length > len(data):
            raise ValueError("it ends in the middle of a field")
        yield number, data[at : at + length]
        at += length


def _varint(data: memoryview, at: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 70, 7):
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
    raise ValueError(f"a number of more than ten bytes at byte {at}")


def _text(value: memoryview | int) -> str:
    return str(value) if isinstance(value, int) else bytes(value).decode("utf-8", "replace")
