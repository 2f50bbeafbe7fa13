"""Fuzzing: random gate inputs, hostile commands and frames, against what must always hold."""
