"""Compiled integration of many motions."""
