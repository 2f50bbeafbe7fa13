"""Servoing methods that the benchmark compares."""
