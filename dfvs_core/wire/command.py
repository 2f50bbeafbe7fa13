"""Signed operator commands: HMAC-SHA256 over vehicle, action, argument and the service's challenge.

No clock is compared: the service publishes a random challenge, changes it every few seconds and
accepts each one once. A recorded command is worthless as soon as it was used or its challenge is
gone, and worthless to any other vehicle.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import re
from dataclasses import dataclass

from dfvs_core.errors import ConfigError, WireError
from dfvs_core.gate.events import Action
from dfvs_core.schema import dump, parse

COMMAND_FORMAT = "dfvs-command/2"
MAX_COMMAND_BYTES = 1024
MIN_KEY_BYTES = 16

_DIGEST = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True, slots=True)
class SignedCommand:
    """An operator's command as it travels; ``mac`` is hexadecimal.

    ``argument`` is the digest of the goal for ``goal``, and empty for the other actions.
    """

    vehicle: str
    action: Action
    challenge: str
    mac: str
    argument: str = ""
    format: str = COMMAND_FORMAT


def command_mac(key: bytes, vehicle: str, action: Action, challenge: str, argument: str) -> str:
    """Message authentication code of a command, hexadecimal."""
    # JSON of a list keeps the fields apart whatever they hold.
    text = json.dumps([COMMAND_FORMAT, vehicle, str(action), challenge, argument])
    return hmac.new(key, text.encode(), hashlib.sha256).hexdigest()


def encode_command(
    key: bytes, vehicle: str, action: Action, challenge: str, argument: str = ""
) -> bytes:
    """Bytes of a signed command."""
    mac = command_mac(key, vehicle, action, challenge, argument)
    command = SignedCommand(vehicle, action, challenge, mac, argument)
    return json.dumps(dump(command)).encode()


def decode_command(data: bytes) -> SignedCommand:
    """Read a command; who sent it is not known before its MAC was compared.

    Raises
    ------
    WireError
        If the bytes are too many, not JSON, or do not follow the schema.
    """
    if len(data) > MAX_COMMAND_BYTES:
        raise WireError(f"command of {len(data)} bytes", f"at most {MAX_COMMAND_BYTES}")
    try:
        command = parse(SignedCommand, json.loads(data))
    except (ValueError, RecursionError, ConfigError) as error:
        raise WireError(f"command cannot be read: {error}") from error
    if command.format != COMMAND_FORMAT:
        raise WireError(f"command has format {command.format!r}", repr(COMMAND_FORMAT))
    if command.action is Action.GOAL and not _DIGEST.fullmatch(command.argument):
        raise WireError("command for a goal names none", "the SHA-256 of a goal as its argument")
    if command.action is not Action.GOAL and command.argument:
        raise WireError(f"command {str(command.action)!r} has an argument", "none")
    return command
