"""The gate process: the only owner of the autopilot."""
