"""The vehicle's MAVLink side: links, streams, telemetry and parameters."""
