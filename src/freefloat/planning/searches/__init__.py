"""Searches that know no problem: patterns, adversaries, lines."""
