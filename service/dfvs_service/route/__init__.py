"""Taking goals: one picture by hand, or a route from a flight."""
