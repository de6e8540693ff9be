"""What is around the robot: bodies, still or tumbling, and a corridor."""
