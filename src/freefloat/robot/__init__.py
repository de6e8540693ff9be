"""The robot: URDF files, assembly, rigid-body model."""
