"""Endings of compiled motions, what decided them, and the tolerances of their steps."""

from __future__ import annotations

from freefloat.motion.problem import Problem

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
STEP_TOLERANCE = 1e-6
"""Relative and absolute tolerance of integration steps, by default."""
_HEADING_TOLERANCE = 1e-9
"""Tolerance where initial attitudes are headings: limits of ranges are then exact to 1e-7 rad."""


def step_tolerance(problem: Problem) -> float:
    """Tolerance of integration steps at which minima are exact enough for verdicts."""
    return _HEADING_TOLERANCE if problem.has_headings else STEP_TOLERANCE
