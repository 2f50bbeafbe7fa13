"""Model bundles: read, verified, and run by ONNX Runtime."""

DEFAULT_MATCHER = "dfvs-flow"
"""What the service and the benchmark use where nobody names a matcher."""
