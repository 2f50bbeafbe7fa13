"""Operating-system services that more than one room needs."""
