"""Signed operator commands: HMAC-SHA256 over all fields and a challenge of the service.

No clock is compared: the service publishes a random challenge, changes it every few seconds and
accepts each one once. A recorded command is worthless as soon as it was used or its challenge is
gone, and worthless to any other vehicle. The answer to a command names its request id.
"""

import hashlib
import hmac
import json
import re
from dataclasses import dataclass

from dfvs_core.errors import WireError
from dfvs_core.gate.events import Action
from dfvs_core.messages.schema import from_json, to_json

COMMAND_FORMAT = "dfvs-command/3"
MAX_COMMAND_BYTES = 1024
MIN_KEY_BYTES = 16

_DIGEST = re.compile(r"[0-9a-f]{64}")
_NONCE = re.compile(r"[0-9a-f]{32}")


@dataclass(frozen=True, slots=True)
class Command:
    """An operator's command.

    ``nonce`` is 128 random bits, hexadecimal, and tells this command from every other one.
    ``argument`` is the digest of the goal for ``goal``, and empty for the other actions.
    """

    vehicle: str
    action: Action
    challenge: str
    nonce: str
    argument: str = ""


@dataclass(frozen=True, slots=True)
class SignedCommand:
    """A command as it travels; ``mac`` is hexadecimal."""

    command: Command
    mac: str
    format: str = COMMAND_FORMAT


def command_mac(key: bytes, command: Command) -> str:
    """Message authentication code of a command, hexadecimal."""
    # JSON of a list keeps the fields apart whatever they hold.
    fields = [command.vehicle, str(command.action), command.challenge]
    text = json.dumps([COMMAND_FORMAT, *fields, command.nonce, command.argument])
    return hmac.new(key, text.encode(), hashlib.sha256).hexdigest()


def encode_command(key: bytes, command: Command) -> bytes:
    """Bytes of a signed command."""
    return to_json(SignedCommand(command, command_mac(key, command)))


def request_id(data: bytes) -> str:
    """Id of a command by its bytes, 32 hexadecimal digits.

    It depends on every byte: a forged command never has the id of somebody else's.
    """
    return hashlib.sha256(data).hexdigest()[:32]


def decode_command(data: bytes) -> SignedCommand:
    """Read a command; who sent it is not known before its MAC was compared.

    Raises
    ------
    WireError
        If the bytes are too many, not JSON, or do not follow the schema.
    """
    if len(data) > MAX_COMMAND_BYTES:
        raise WireError(f"command of {len(data)} bytes", f"at most {MAX_COMMAND_BYTES}")
    signed = from_json(SignedCommand, data)
    if signed.format != COMMAND_FORMAT:
        raise WireError(f"command has format {signed.format!r}", repr(COMMAND_FORMAT))
    command = signed.command
    if not _NONCE.fullmatch(command.nonce):
        raise WireError("command without a nonce", "32 hexadecimal digits")
    if command.action is Action.GOAL and not _DIGEST.fullmatch(command.argument):
        raise WireError("command for a goal names none", "the SHA-256 of a goal as its argument")
    if command.action is not Action.GOAL and command.argument:
        raise WireError(f"command {str(command.action)!r} has an argument", "none")
    return signed
