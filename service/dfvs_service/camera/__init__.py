"""Image sources, their publication and calibration, and capture of goal images."""
