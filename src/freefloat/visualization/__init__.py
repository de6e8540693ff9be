"""Figures, pages, pictures and videos of results."""

import warnings

with warnings.catch_warnings():  # MeshCat imports a deprecated module of pyzmq
    warnings.simplefilter("ignore", DeprecationWarning)
    import meshcat as meshcat
