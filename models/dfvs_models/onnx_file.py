"""What an ONNX file asks for, read from its bytes before any library acts on them.

ONNX is protocol buffers: a message is a run of (field number, wire type, value). Only the few
fields are followed that lead to nodes and tensors (onnx.proto); everything else is skipped.
"""

from __future__ import annotations

from collections.abc import Iterator

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
    "tensor": {},
}
_NODE_OPERATOR, _NODE_DOMAIN = 4, 7
_TENSOR_EXTERNAL_DATA, _TENSOR_LOCATION = 13, 14


def check_onnx(data: bytes, name: str) -> None:
    """Refuse an ONNX file that needs more than itself and the standard operators.

    Raises
    ------
    ModelError
        If it cannot be read, keeps weights outside itself, or uses operators that are not
        ONNX's own.
    """
    try:
        _check_message(memoryview(data), "model", name, 0)
    except (IndexError, ValueError) as error:
        raise ModelError(f"{name!r} is not a readable ONNX file ({error})") from error


def _check_message(data: memoryview, kind: str, name: str, depth: int) -> None:
    if depth > _MOST_DEEP:
        raise ModelError(f"{name!r} nests graphs more than {_MOST_DEEP} deep")
    operator, domain = "", ""
    for number, value in _fields(data):
        if kind == "node" and number == _NODE_OPERATOR:
            operator = _text(value)
        elif kind == "node" and number == _NODE_DOMAIN:
            domain = _text(value)
        elif kind == "tensor" and number in (_TENSOR_EXTERNAL_DATA, _TENSOR_LOCATION) and value:
            raise ModelError(
                f"{name!r} keeps weights in another file", "all weights inside the ONNX file"
            )
        elif number in _PATHS[kind] and isinstance(value, memoryview):
            _check_message(value, _PATHS[kind][number], name, depth + 1)
    if domain not in STANDARD_DOMAINS:
        raise ModelError(
            f"{name!r} uses the operator {operator!r} of the domain {domain!r}",
            "ONNX's own operators only",
        )


def _fields(data: memoryview) -> Iterator[tuple[int, memoryview | int]]:
    """Go through a message: field number and value, bytes for a sub-message or text."""
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        number, wire_type = key >> 3, key & 7
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
        if wire_type == _BYTES:
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
