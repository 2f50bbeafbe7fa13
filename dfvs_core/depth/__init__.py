"""Depth of the current view, from whatever there is to go by, behind one interface."""
