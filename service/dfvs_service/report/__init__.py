"""Self-contained HTML reports of flights."""
