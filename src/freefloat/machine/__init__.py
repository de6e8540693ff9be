"""The machine: its model, momentum, generalized Jacobian and measures of singularity."""
