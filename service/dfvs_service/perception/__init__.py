"""The process that looks: frames in, reports for the gate and telemetry out.

It may hang or crash without harm: it does not own the autopilot.
"""
