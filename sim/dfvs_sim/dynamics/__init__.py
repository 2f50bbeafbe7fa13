"""Motion of the simulated vehicle: rigid body, control, wind and state estimator."""
