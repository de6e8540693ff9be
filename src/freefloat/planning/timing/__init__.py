"""Timing of planned motions."""
