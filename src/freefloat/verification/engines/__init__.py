"""Other engines: MuJoCo and Basilisk."""
