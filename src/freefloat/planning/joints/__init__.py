"""Motions whose joints are prescribed."""
