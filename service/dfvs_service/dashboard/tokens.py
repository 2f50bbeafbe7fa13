"""Access tokens of viewers and operators, compared in constant time."""

import enum
import hashlib
import hmac
from dataclasses import dataclass


class Role(enum.IntEnum):
    """What a browser may do; each one includes those before it."""

    NOBODY = 0
    VIEWER = 1
    OPERATOR = 2


@dataclass(frozen=True, slots=True)
class Tokens:
    """Secrets of viewers and operators.

    None where nobody can sign in as such; ``is_open``: everybody who reaches the page may look.
    """

    viewer: bytes | None = None
    operator: bytes | None = None
    is_open: bool = False

    def role_of(self, token: str) -> Role:
        """Role that a token gives; the empty one gives what everybody has."""
        presented = token.encode(errors="replace")
        is_operator = _same(presented, self.operator)
        is_viewer = _same(presented, self.viewer)
        if is_operator:
            return Role.OPERATOR
        if is_viewer or (self.is_open and not token):
            return Role.VIEWER
        return Role.NOBODY


def _same(presented: bytes, secret: bytes | None) -> bool:
    """Compare digests, so that neither content nor length can be told from the time taken."""
    if secret is None:
        return False
    ours, theirs = hashlib.sha256(secret).digest(), hashlib.sha256(presented).digest()
    return hmac.compare_digest(ours, theirs)
