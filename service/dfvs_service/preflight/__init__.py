"""Preflight check (``dfvs-service --check``), which moves nothing."""
