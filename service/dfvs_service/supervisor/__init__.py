"""Parent process, and utilities shared with its children."""
