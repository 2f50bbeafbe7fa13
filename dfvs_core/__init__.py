"""Pure core of DFVS: camera, interaction matrix, depth, servo law, perception, gate, messages.

Nothing in here reads a clock, a file, the environment or the network, and nothing logs.
Time comes in as monotonic nanoseconds, randomness as a ``numpy.random.Generator``.
"""
