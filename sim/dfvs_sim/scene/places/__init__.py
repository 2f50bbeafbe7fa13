"""Places with a use of their own: what stands where is planned, the rest is drawn from a seed."""
