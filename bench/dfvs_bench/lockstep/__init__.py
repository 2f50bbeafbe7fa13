"""Flights in simulated time: vehicle, camera, perception and gate in one process, in lockstep."""
