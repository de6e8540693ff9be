"""A URDF: read, put together, doubted."""
