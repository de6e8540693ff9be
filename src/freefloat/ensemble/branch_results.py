"""Results of the motions from many attitudes, arm branch by arm branch."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ensemble.endings import COMPLETED, UNREACHED
from freefloat.ensemble.result import EnsembleResult
from freefloat.ik.branches import ClosedForm, closed_form
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, IntArray

_NEGLIGIBLE = 1e-7
"""Fraction of the system's mass and inertia below which a body counts as massless."""


@dataclass(frozen=True, eq=False)
class BranchResults:
    """Results of the motions from K attitudes along B arm branches each.

    Attributes:
        attitudes: Initial attitudes, quaternions x, y, z, w, shape (K, 4).
        joints: Initial joint values of each arm branch, NaN where it does not exist, (K, B, n).
        motions: Results of their motions, arrays of leading shape (K, B).
    """

    attitudes: Array = field(repr=False)
    joints: Array = field(repr=False)
    motions: EnsembleResult = field(repr=False)

    @property
    def exist(self) -> npt.NDArray[np.bool_]:
        """Where an arm branch exists, shape (K, B)."""
        return np.asarray(self.motions.endings != UNREACHED)

    @property
    def margins(self) -> Array:
        """Minimum magnitudes of the measure, zero for motions that do not complete, (K, B)."""
        return np.where(self.motions.endings == COMPLETED, self.motions.minimum, 0.0)

    @property
    def existing_margins(self) -> Array:
        """As :attr:`margins`, but nan where there is no such arm branch."""
        return np.where(self.exist, self.margins, np.nan)

    def columns(self, numbers: IntArray) -> BranchResults:
        """The results of some of the columns."""
        return BranchResults(self.attitudes, self.joints[:, numbers], self.motions.columns(numbers))


def has_wrist_flipped_branches(problem: Problem) -> bool:
    """Whether branches that differ by the wrist flip alone have the same motion.

    They do when adjacent wrist axes are perpendicular and the bodies between them are massless:
    rotating the fourth and sixth joints by pi and reversing the fifth gives the same end-effector
    pose and moves no mass. Branch 2 k + 1 is then the wrist-flipped branch of branch 2 k.
    """
    virtual, model = VirtualManipulator.of(problem.model), problem.model
    if closed_form(model, problem.task) is not ClosedForm.ELBOW_AND_WRIST:
        return False
    if problem.start_joints is not None:  # of two wrist-flipped branches one is considered
        return False
    h4, h5, h6 = virtual.axes_at(np.zeros(6))[3:]
    heaviest = max(np.abs(body.inertia).max() for body in model.bodies)
    massless = all(
        body.mass < _NEGLIGIBLE * model.total_mass
        and np.abs(body.inertia).max() < _NEGLIGIBLE * heaviest
        for body in model.bodies[4:6]
    )
    return massless and bool(max(abs(h4 @ h5), abs(h5 @ h6)) < _NEGLIGIBLE)
