"""Room types, each made from a seed."""
