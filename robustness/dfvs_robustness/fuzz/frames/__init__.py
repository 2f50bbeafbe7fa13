"""Fuzzing of the decoder: hostile camera frames."""
