"""What a step costs as the mesh grows."""
