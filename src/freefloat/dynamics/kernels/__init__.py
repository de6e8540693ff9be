"""The equation of motion in compiled form."""
