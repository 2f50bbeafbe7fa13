"""Black box: the records of every flight, and the commands that list, open and export them."""
