"""Codes of the endings of compiled motions, and of what decided them."""

from __future__ import annotations

COMPLETED, SINGULAR, MARGIN, FAILED, LIMITED = 0, 1, 2, 3, 4
"""The path was followed; the arm became singular; the margin was used up; the steps were used up;
the path was followed, and a limit of attitude is violated."""
UNREACHED = -1
"""The arm branch does not exist at the attitude."""
MAX_STEPS = 20_000
"""Steps after which a motion fails."""
NORMAL, FINE, STRICT, MOTION = range(4)
DECIDERS = "ensemble", "ensemble at 1e-8", "ensemble at 1e-10", "motion"
"""What decided a motion: an ensemble, another one with that tolerance, or a precise motion."""
