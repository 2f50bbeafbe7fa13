"""Signed commands for tests: each call makes one that was never sent before."""

import secrets

from dfvs_core.gate.commands.command import Command, encode_command
from dfvs_core.gate.events import Action


def signed(key: bytes, vehicle: str, action: Action, challenge: str, argument: str = "") -> bytes:
    """Bytes of a command with a nonce of its own."""
    return encode_command(key, Command(vehicle, action, challenge, secrets.token_hex(16), argument))
