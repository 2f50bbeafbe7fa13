"""Model bundles: read, verified, and run by ONNX Runtime."""
