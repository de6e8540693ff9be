"""Which initial attitudes are feasible, and which to choose."""
