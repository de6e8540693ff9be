"""Another engine: MuJoCo."""
