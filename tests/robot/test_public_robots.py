"""Robots as others publish them: URDFs without limits, scenes of MuJoCo."""
