"""Goals, reorientation, manoeuvres of phases, and capture."""
