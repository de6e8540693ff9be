"""What a motion asks of joints, drives, base and surroundings."""
