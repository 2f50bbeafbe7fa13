"""Scenes: triangle meshes with textures and baked light, and where to look at them from."""
