"""What is beyond the paper; the planner does not know it."""
