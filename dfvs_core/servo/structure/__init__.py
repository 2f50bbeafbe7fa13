"""Structure of the scene from two views: relative depth, and the motion between them."""
