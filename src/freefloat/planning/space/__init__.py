"""Spatial arms: maps of SO(3) and searches in it."""
