"""Compiled integration of ensembles."""
