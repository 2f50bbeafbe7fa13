"""Gate process, the only owner of the autopilot."""
