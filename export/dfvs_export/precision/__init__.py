"""Bundles with fewer bits."""
