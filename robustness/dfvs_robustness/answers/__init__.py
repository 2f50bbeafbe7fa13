"""Answer times of commands, and rate of the state."""
