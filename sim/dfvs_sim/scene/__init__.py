"""Scenes: triangle meshes with textures and baked light, and where to look at them from."""

from __future__ import annotations

from pathlib import Path


def builtin_room_path() -> Path:
    """Path of the living room that comes with the package."""
    return Path(__file__).resolve().parent.parent / "assets" / "living_room.glb"
