"""Formats of other tools: xacro, MuJoCo, ROS 2, CCSDS."""
