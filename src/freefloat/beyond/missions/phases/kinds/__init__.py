"""Kinds of phases: a module for each."""
