"""Dynamics of free-floating robots: momentum, resolved rates, singularity measures."""
