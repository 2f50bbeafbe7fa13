"""Fuzzing of the command ingress: hostile commands through admission and authority."""
