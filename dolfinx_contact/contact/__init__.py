"""Contact points of a body and the rigid planes that they may touch."""
