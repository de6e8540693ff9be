"""Manoeuvres: phases after one another."""
