"""Feasible initial attitudes, and the choice of one."""
