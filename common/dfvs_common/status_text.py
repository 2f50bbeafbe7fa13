"""Texts of and about autopilots, as people read them."""

import unicodedata
from collections.abc import Collection


def plain_text(text: str) -> str:
    """Text of the autopilot on one line, without control characters.

    PX4 ends a STATUSTEXT with a tab where it tells the same as an event too.
    """
    printable = (" " if unicodedata.category(letter) == "Cc" else letter for letter in text)
    return " ".join("".join(printable).split())


def system_names(systems: Collection[int]) -> str:
    """``system 3``, or ``systems 3 and 7``."""
    *most, last = [str(system) for system in sorted(systems)]
    return f"systems {', '.join(most)} and {last}" if most else f"system {last}"
