"""Where an arm is singular in its whole joint space: certified maps, their parts, distances."""
