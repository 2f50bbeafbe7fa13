"""The ground station's side: its one MAVLink link, and the stand-in pilot."""
