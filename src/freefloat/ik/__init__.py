"""Arm branches: inverse kinematics at a given spacecraft attitude."""
