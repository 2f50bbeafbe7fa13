"""A long flight from goal to goal, and what it does to the memory of the service's processes."""
