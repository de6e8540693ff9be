"""Mutated files of every kind, and the outcomes of reading them, for ``scripts/lab/fuzz.py``."""
