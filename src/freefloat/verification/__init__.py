"""Verification of saved results."""
