"""Tasks, trials and the runs of them."""
