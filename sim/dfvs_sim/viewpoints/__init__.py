"""Viewpoints in a scene: free space and sampled camera poses."""
