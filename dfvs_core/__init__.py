"""The science of DFVS, pure: frames, camera, interaction matrix, depth, servo law, gate.

Nothing in here reads a clock, a file, the environment or the network, and nothing logs.
Time comes in as monotonic nanoseconds, randomness as a ``numpy.random.Generator``.
"""
