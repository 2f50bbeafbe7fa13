"""Identity of this machine's monotonic clock."""

from pathlib import Path

from dfvs_core.messages.frame import BOOT_ID_FILE, clock_identity


def local_clock() -> bytes:
    """Identity (16 bytes) by which frames name the clock that they are stamped with.

    Raises
    ------
    WireError
        If the kernel's boot id is none.
    """
    return clock_identity(Path(BOOT_ID_FILE).read_text(encoding="ascii"))
