"""Goal command message: sidecar and image in one payload, and its digest.

The operator signs the digest; the service looks at the image only after it was found signed.
"""

from __future__ import annotations

import hashlib
import struct
from dataclasses import dataclass

from dfvs_core.errors import WireError
from dfvs_core.messages.zenoh_settings import MAX_MESSAGE_BYTES

_HEADER = struct.Struct("<4sI")
_MAGIC = b"DFVG"
MAX_SIDECAR_BYTES = 64 * 1024


@dataclass(frozen=True, slots=True)
class GoalCommand:
    """PNG or JPEG bytes of a goal image, and its sidecar's JSON (empty: taken as level)."""

    image: bytes
    sidecar: str = ""

    def to_bytes(self) -> bytes:
        """Payload of the goal.

        Raises
        ------
        WireError
            If it is too large to be sent.
        """
        sidecar = self.sidecar.encode()
        data = _HEADER.pack(_MAGIC, len(sidecar)) + sidecar + self.image
        if len(sidecar) > MAX_SIDECAR_BYTES or len(data) > MAX_MESSAGE_BYTES:
            raise WireError(
                f"goal of {len(data)} bytes, {len(sidecar)} of them sidecar",
                f"at most {MAX_MESSAGE_BYTES} and {MAX_SIDECAR_BYTES} bytes",
                "send the image as JPEG",
            )
        return data

    @classmethod
    def from_bytes(cls, data: bytes) -> GoalCommand:
        """Read a payload; the image is not looked at.

        Raises
        ------
        WireError
            If it is not a goal.
        """
        if len(data) > MAX_MESSAGE_BYTES or data[:4] != _MAGIC or len(data) < _HEADER.size:
            raise WireError(f"goal of {len(data)} bytes begins with {data[:4]!r}", repr(_MAGIC))
        _, length = _HEADER.unpack_from(data)
        end = _HEADER.size + length
        if length > MAX_SIDECAR_BYTES or end > len(data):
            raise WireError(f"goal with a sidecar of {length} bytes", "as many as it holds")
        try:
            sidecar = data[_HEADER.size : end].decode()
        except UnicodeDecodeError as error:
            raise WireError("the goal's sidecar is not UTF-8") from error
        return cls(data[end:], sidecar)


def goal_digest(data: bytes) -> str:
    """SHA-256 of a payload, hexadecimal: what the operator signs."""
    return hashlib.sha256(data).hexdigest()
