"""Light: fast or path-traced, and baked into a room's vertices."""
