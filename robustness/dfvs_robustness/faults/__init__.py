"""Faults on purpose: the real service in a cheap world, disturbed from outside, and judged."""
