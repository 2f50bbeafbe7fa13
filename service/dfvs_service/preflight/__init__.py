"""``dfvs-service --check``: everything that must be right, looked at without moving anything."""
