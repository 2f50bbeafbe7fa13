"""Telemetry of perception: documents, images and latency."""
