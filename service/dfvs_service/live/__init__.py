"""Live views of a flight for tools that people already have: Foxglove and Prometheus."""
