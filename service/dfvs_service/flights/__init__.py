"""Black box: records of every flight, and the commands that list, show and export them."""
