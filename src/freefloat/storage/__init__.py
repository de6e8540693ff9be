"""Plans, maps, robots and trajectories on disk."""
