"""End-effector paths and their timing."""
