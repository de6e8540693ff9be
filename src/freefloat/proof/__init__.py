"""What a motion proves of itself, by other integrators and another engine."""
