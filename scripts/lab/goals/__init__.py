"""Random goals, and paths for a spacecraft that does not move."""
