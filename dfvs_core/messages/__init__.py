"""What travels between processes: frames, reports, vehicle state, telemetry, commands."""
