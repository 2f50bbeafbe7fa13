"""Scenes: triangle meshes with textures and baked light, and where to look at them from."""

from pathlib import Path

_ASSETS = Path(__file__).resolve().parent.parent / "assets"


def builtin_room_path() -> Path:
    """Path of the living room that comes with the package."""
    return _ASSETS / "living_room.glb"


def two_rooms_path() -> Path:
    """Path of the two rooms with a doorway between them that come with the package."""
    return _ASSETS / "two_rooms.glb"
