"""Limits in planning: screening, trials, keeping."""
