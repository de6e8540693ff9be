"""Compiled kernels of the equation of motion."""
