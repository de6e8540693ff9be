"""The robot: from a URDF to a rigid-body model."""
