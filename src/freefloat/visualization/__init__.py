"""Figures, scenes and pages."""
