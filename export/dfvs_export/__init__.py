"""Networks, training data, training and export: the only room that knows torch."""
