"""Replay of perception on a recorded flight."""
