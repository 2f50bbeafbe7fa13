"""Image-based visual servoing: from dense correspondences and depth to a velocity.

Read in this order: ``points`` (which pixels count), ``interaction`` (how they move),
``freedom`` (which motions the vehicle has), ``pose`` (where the goal is), ``law`` (the
velocity), ``stop`` (when it is enough), ``step`` (all of it for one frame).
"""
