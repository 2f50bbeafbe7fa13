"""Procedural materials and textures."""
