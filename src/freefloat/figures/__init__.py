"""Figures; nothing is computed here."""
