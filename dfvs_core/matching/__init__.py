"""Dense correspondences between two pictures: the matchers and how good they are."""
