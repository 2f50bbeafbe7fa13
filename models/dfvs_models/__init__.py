"""Model bundles: reading, verification, inference with ONNX Runtime."""

import os

os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
"""ONNX Runtime reports to its makers what is run unless this is set before its import."""

DEFAULT_MATCHER = "dfvs-flow"
"""What the service and the benchmark use where nobody names a matcher."""

DEFAULT_DEPTH = "dfvs-depth"
"""The depth network that they use where nobody names one."""
