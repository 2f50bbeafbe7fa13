"""Layout, furniture and solids of a generated room."""
