"""Messages between processes: frames, reports, vehicle state, telemetry, commands."""
