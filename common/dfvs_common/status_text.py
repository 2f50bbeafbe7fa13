"""Texts of an autopilot, as people read them."""

import unicodedata


def plain_text(text: str) -> str:
    """Text of the autopilot on one line, without control characters.

    PX4 ends a STATUSTEXT with a tab where it tells the same as an event too.
    """
    printable = (" " if unicodedata.category(letter) == "Cc" else letter for letter in text)
    return " ".join("".join(printable).split())
