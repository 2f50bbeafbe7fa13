"""Training of the networks, and its data."""
