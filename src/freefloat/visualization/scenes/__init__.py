"""Scenes of MeshCat."""

import warnings

with warnings.catch_warnings(action="ignore", category=DeprecationWarning):
    import meshcat  # of what it imports, zmq warns

__all__ = ["meshcat"]
