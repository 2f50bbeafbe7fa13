"""Image-based visual servoing: from dense correspondences and depth to a velocity.

Read in this order: ``points`` (pixels used), ``interaction`` (their motion), ``freedom`` (motions
of the vehicle), ``pose`` (goal pose), ``law`` (velocity), ``checks.stop`` (stop rule), ``step``
(one frame as a whole).
"""
