"""Messages of a browser: JSON objects, and goal images with a JSON header."""

import json
import struct
from typing import Any

from dfvs_core.messages.goal_command import MAX_SIDECAR_BYTES, GoalCommand

_LENGTH = struct.Struct("<I")
_MAX_HEADER_BYTES = 2 * MAX_SIDECAR_BYTES
_IMAGE = "image"


def read_message(text: str | None, data: bytes | None) -> dict[str, Any]:
    """Read a message; what cannot be read is taken for an empty one.

    ``data`` is the length of a header (uint32, little-endian), the header as JSON, and an image,
    which is put into the message beside the header's values.
    """
    image = None
    if data is not None:
        if len(data) < _LENGTH.size:
            return {}
        end = _LENGTH.size + _LENGTH.unpack_from(data)[0]
        if end > min(len(data), _MAX_HEADER_BYTES):
            return {}
        header, image = data[_LENGTH.size : end], data[end:]
        text = header.decode(errors="replace")
    try:
        message = json.loads(text or "")
    except (ValueError, RecursionError):
        return {}
    if not isinstance(message, dict):
        return {}
    message.pop(_IMAGE, None)
    return message if image is None else message | {_IMAGE: image}


def commanded_goal(message: dict[str, Any]) -> GoalCommand | None:
    """Goal that came with a command, or None."""
    image = message.get(_IMAGE)
    if not isinstance(image, bytes):
        return None
    sidecar = message.get("sidecar", "")
    return GoalCommand(image, sidecar if isinstance(sidecar, str) else "")
