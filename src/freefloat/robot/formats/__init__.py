"""Robots in other formats: xacro and MJCF."""
