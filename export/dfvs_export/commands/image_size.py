"""Image sizes as options name them."""

from __future__ import annotations

from dfvs_core.errors import ConfigError


def parse_size(text: str, multiple: int = 16) -> tuple[int, int]:
    """(width, height) px from ``"320x240"``.

    Raises
    ------
    ConfigError
        If the text is no size, or not of multiples of ``multiple``.
    """
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(p.isdecimal() for p in parts):
        raise ConfigError(f"size {text!r}", "WIDTHxHEIGHT in px, such as 320x240")
    width, height = int(parts[0]), int(parts[1])
    if width < 64 or height < 64 or width % multiple or height % multiple:
        raise ConfigError(f"size {text!r}", f"multiples of {multiple}, 64 px or more")
    return width, height
