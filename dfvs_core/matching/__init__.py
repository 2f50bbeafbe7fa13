"""Dense correspondences between two images."""
