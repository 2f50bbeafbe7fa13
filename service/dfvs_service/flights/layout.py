"""File names of a flight's records."""

from __future__ import annotations

FORMAT = "dfvs-flight/1"

HEADER = "flight.json"
"""Format, vehicle, time of the start on both clocks, version."""
SETTINGS = "settings.json"
BUILD = "build.json"
"""Versions of code and libraries, SHA-256 of the model's files."""
GATE_LOG = "gate.jsonl"
GATE_INPUTS = "gate-inputs.jsonl"
SERVICE_LOG = "service.jsonl"
TELEMETRY = "telemetry"
"""Stem of the segments: ``telemetry-000.jsonl``, ..."""
THUMBNAILS = "thumbnails"
GOALS = "goals"
"""Goal images as they were published, by monotonic time."""
