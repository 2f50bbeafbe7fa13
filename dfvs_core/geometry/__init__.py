"""Cameras, poses, the interaction matrix and the arrays that carry them."""
