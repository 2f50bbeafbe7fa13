"""Fault matrix: the real service, disturbed from outside in every state, and judged."""
