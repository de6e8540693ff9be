"""Proof of a motion: bounds between its nodes, for all times."""
