"""One flight: its processes, links and ports, brought up, flown and brought down."""
