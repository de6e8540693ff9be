"""Scenario files: their schema, how they are read, the problem they pose."""
