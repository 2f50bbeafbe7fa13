"""Gate: state machine that limits velocities and alone commands the autopilot.

It knows nothing of images. Events and monotonic time go in, setpoints, mode requests and logged
transitions come out; it does no I/O, so that a recorded flight can be replayed through it.
"""
