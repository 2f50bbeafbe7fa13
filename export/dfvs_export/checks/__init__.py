"""Comparison of bundles with torch, their accuracy and their times."""
