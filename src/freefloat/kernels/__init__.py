"""The machine compiled: rooms ending in ``_kernels`` hold machine code, two feed it."""
