"""Compiled forward kinematics and momentum equation of robots in lock step."""
