"""Another engine, MuJoCo: it repeats motions, and simulates controllers that follow them."""
