"""Fuzzing of the gate: random episodes, and its invariants after every step."""
