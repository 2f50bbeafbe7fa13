"""Live telemetry for Foxglove and Prometheus."""
