"""Typed arrays inside a glTF document's binary chunk."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

_TYPES: dict[int, type[np.generic]] = {
    5120: np.int8,
    5121: np.uint8,
    5122: np.int16,
    5123: np.uint16,
    5125: np.uint32,
    5126: np.float32,
}
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


@dataclass(frozen=True, slots=True)
class Document:
    """A parsed file: the JSON document and the binary chunk that it points into."""

    json: dict[str, Any]
    binary: bytes


def read_view(document: Document, index: int) -> bytes:
    """Bytes of one buffer view.

    Raises
    ------
    ValueError
        If it does not lie inside the file.
    """
    view = document.json["bufferViews"][index]
    if view["buffer"] != 0 or "uri" in document.json["buffers"][0]:
        raise ValueError("data outside the file")
    first = int(view.get("byteOffset", 0))
    last = first + int(view["byteLength"])
    if not 0 <= first <= last <= len(document.binary):
        raise ValueError(f"buffer view {index} ends at byte {last} of {len(document.binary)}")
    return document.binary[first:last]


def read_accessor(document: Document, index: int) -> NDArray[Any]:
    """Array (N, components) of one accessor.

    Normalised integers become float32 in 0 to 1 (or -1 to 1), other types stay as they are.

    Raises
    ------
    ValueError
        If it does not lie inside its buffer view, or is sparse.
    KeyError
        If its type is unknown.
    """
    accessor = document.json["accessors"][index]
    if "sparse" in accessor:
        raise ValueError("sparse accessors are not supported")
    dtype = np.dtype(_TYPES[accessor["componentType"]]).newbyteorder("<")
    width, count = _COMPONENTS[accessor["type"]], int(accessor["count"])
    if "bufferView" not in accessor:
        return np.zeros((count, width), dtype)
    data = read_view(document, accessor["bufferView"])
    item = dtype.itemsize * width
    stride = int(document.json["bufferViews"][accessor["bufferView"]].get("byteStride", item))
    first = int(accessor.get("byteOffset", 0))
    if count < 1 or first < 0 or stride < item or first + (count - 1) * stride + item > len(data):
        raise ValueError(f"accessor {index} runs past its {len(data)} bytes")
    values: NDArray[Any] = np.ndarray((count, width), dtype, data, first, (stride, dtype.itemsize))
    if accessor.get("normalized", False) and dtype.kind in "iu":
        scaled = values.astype(np.float32) / np.float32(np.iinfo(dtype).max)
        return np.asarray(np.maximum(scaled, np.float32(-1.0)))
    return values.copy()
