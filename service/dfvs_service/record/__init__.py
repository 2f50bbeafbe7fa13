"""Recordings of flights as MCAP files, which Foxglove opens and ``dfvs-replay`` reruns."""
