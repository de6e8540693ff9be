"""Motions of the joints from a state to a goal, found by optimization."""
