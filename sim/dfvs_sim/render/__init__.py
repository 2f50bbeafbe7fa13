"""Renderer: colour, exact depth and exact flow of a scene."""
