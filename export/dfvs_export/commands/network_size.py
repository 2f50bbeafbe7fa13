"""Image sizes that networks can take."""

from dfvs_common.command_line import parse_size
from dfvs_core.errors import ConfigError


def network_size(text: str, multiple: int = 16) -> tuple[int, int]:
    """(width, height) px from ``"320x240"``.

    Raises
    ------
    ConfigError
        If the text is no size, or not of multiples of ``multiple``.
    """
    width, height = parse_size(text)
    if width < 64 or height < 64 or width % multiple or height % multiple:
        raise ConfigError(f"--size is {text!r}", f"multiples of {multiple}, 64 px or more")
    return width, height
