"""Figures, pages, pictures and videos of results."""
