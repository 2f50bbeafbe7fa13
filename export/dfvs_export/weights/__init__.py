"""Weights of networks: read from checkpoints and published files, and written."""
