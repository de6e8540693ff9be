"""The ``freefloat`` command: what it understands, whom it asks, what it shows."""
