"""Fuzzing: random gate inputs and hostile frames, by the million, against what must always hold."""
