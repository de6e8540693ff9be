"""Limits on joints, rates, torques and clearance along a motion."""
