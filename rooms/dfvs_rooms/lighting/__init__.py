"""Light: fast lighting, path-traced lighting, exposure."""
