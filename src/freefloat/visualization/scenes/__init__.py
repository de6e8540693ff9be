"""Scenes of MeshCat."""
