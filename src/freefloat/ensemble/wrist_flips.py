"""Arm branches that differ by the flip of a spherical wrist."""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ensemble.result import EnsembleResult
from freefloat.ik.branches import ClosedForm, closed_form
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, BoolArray

_NEGLIGIBLE = 1e-7
"""Fraction of the system's mass and inertia below which a body counts as massless."""
WRIST_BODIES = 4, 5
"""The bodies that wrist-flipped branches place differently."""
_FLIPPED_JOINT = 4
"""The joint of a spherical wrist whose sign differs between wrist-flipped branches."""


def has_wrist_flipped_branches(problem: Problem) -> bool:
    """Whether branches that differ by the wrist flip alone have the same motion.

    They do when adjacent wrist axes are perpendicular and the bodies between them are massless:
    rotating the fourth and sixth joints by pi and reversing the fifth gives the same end-effector
    pose and moves no mass. Branch 2 k + 1 is then the wrist-flipped branch of branch 2 k.
    """
    model = problem.model_at()
    if closed_form(model, problem.task) is not ClosedForm.ELBOW_AND_WRIST:
        return False
    if problem.start_joints is not None:  # of two wrist-flipped branches one is considered
        return False
    h4, h5, h6 = VirtualManipulator.of(model).axes_at(np.zeros(6))[3:]
    heaviest = max(np.abs(body.inertia).max() for body in model.bodies)
    massless = all(
        body.mass < _NEGLIGIBLE * model.total_mass
        and np.abs(body.inertia).max() < _NEGLIGIBLE * heaviest
        for body in model.bodies[4:6]
    )
    return massless and bool(max(abs(h4 @ h5), abs(h5 @ h6)) < _NEGLIGIBLE)


def flip_wrists(
    table: EnsembleResult, derived: BoolArray, integrated: Array, flipped: Array
) -> None:
    """Replace results of branches 2 k by those of their wrist-flipped branches, in place.

    Args:
        table: Results, arrays of leading shape (K, B).
        derived: Which are changed, shape (K, B).
        integrated: Initial joint values of the integrated branches, shape (K, B, 6).
        flipped: Those of the branches of the columns, shape (K, B, 6).
    """
    sign = np.ones(6)
    sign[_FLIPPED_JOINT] = -1.0
    start, offset = integrated[derived], flipped[derived]
    final, low, high = (
        offset + sign * (values[derived] - start)
        for values in (table.joints, table.lower, table.upper)
    )
    table.joints[derived] = final
    table.lower[derived], table.upper[derived] = np.minimum(low, high), np.maximum(low, high)
    table.evaluations[derived] = 0
