"""What initial attitudes lead to: every arm branch found and followed, many at once."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.momentum import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ensemble.ensemble import TOLERANCE, Ensemble, EnsembleIntegrator, Progress
from freefloat.ensemble.kernels.integration import COMPLETED
from freefloat.motion.problem import Problem, require_problem
from freefloat.so3 import Array, frozen

_THRIFT = 4
UNREACHED = -1
"""Ending of an arm branch that does not exist at an attitude."""


@dataclass(frozen=True, eq=False)
class BranchOutcomes:
    """What becomes of the arm branches at some attitudes.

    Attributes:
        attitudes: Quaternions x, y, z, w, shape (K, 4).
        joints: Of each branch at the start, NaN where there is none, shape (K, B, n).
        endings: Codes as in :class:`~freefloat.ensemble.ensemble.Ensemble`, -1 where there is no
            branch, shape (K, B).
        determinant_ratios: Smallest over largest magnitude of det S*; zero where singular or no
            branch, shape (K, B).
        least: Smallest magnitude of the measure; zero where singular or no branch, shape (K, B).
        rollout: The motions, in the order of the branches that exist.
    """

    attitudes: Array
    joints: Array
    endings: npt.NDArray[np.int8]
    determinant_ratios: Array
    least: Array
    rollout: Ensemble

    @property
    def margins(self) -> Array:
        """``least``, and zero for motions that do not complete, shape (K, B)."""
        return np.where(self.endings == COMPLETED, self.least, 0.0)

    def spread(self, values: Array, blank: float = np.nan) -> Array:
        """A quantity of the rollout's motions put where their branches are, shape (K, B, ...)."""
        found = self.endings != UNREACHED
        table = np.full((*found.shape, *values.shape[1:]), blank, dtype=values.dtype)
        table[found] = values
        return table


class FeasibilityEvaluator:
    """Answers, attitude by attitude and branch by branch, whether a path can be followed.

    Where branches have no closed form, finding them takes a millisecond an attitude, far longer
    than following them; ``thrift`` then tells searches to ask for so many times fewer.
    """

    def __init__(
        self, problem: Problem, threads: int | None = None, *, tolerance: float = TOLERANCE
    ) -> None:
        """Prepare a problem.

        Args:
            problem: Robot, path, momentum and margin.
            threads: How many cores to use; all this process may when left out.
            tolerance: Of the motions, relative and absolute, per step.

        Raises:
            InputError: If it is no problem.
        """
        require_problem(problem)
        self.problem = problem
        self.tolerance = tolerance
        self.roller = EnsembleIntegrator(problem, threads)
        self.twins = has_wrist_flipped_branches(problem)
        self.thrift = 1 if has_closed_form(problem) else _THRIFT

    def prospects(
        self,
        attitudes: Array,
        branch: int | None = None,
        *,
        stop_at_margin: bool = False,
        progress: Progress | None = None,
    ) -> BranchOutcomes:
        """Follow the path from many attitudes.

        Args:
            attitudes: Unit quaternions x, y, z, w, shape (K, 4).
            branch: Follow the arm branch with this number alone; all when left out.
            stop_at_margin: Give up motions that break the margin.
            progress: Called with the share done, in [0, 1].
        """
        branches = self.problem.many_branches(attitudes, threads=self.roller.threads)
        joints, found = branches.joints, branches.found
        twins = self.twins and bool((found[:, ::2] == found[:, 1::2]).all())
        first, beyond = (0, joints.shape[1]) if branch is None else (branch, branch + 1)
        leaders = slice(first - first % 2, beyond, 2) if twins else slice(first, beyond)
        followed = found[:, leaders]
        where, _ = np.nonzero(followed)
        own = joints[:, leaders][followed]
        rollout = self.roller.follow(
            attitudes[where], own,
            stop_below=self.problem.margin.threshold if stop_at_margin else 0.0,
            tolerance=self.tolerance, progress=progress,
        )  # fmt: skip
        joints, found = joints[:, first:beyond], found[:, first:beyond]
        if twins and branch is None:
            rollout = _interleaved(rollout, _mirrored(rollout, own, joints[:, 1::2][followed]))
        elif twins and first % 2:
            rollout = _mirrored(rollout, own, joints[followed])
        endings = np.full(found.shape, UNREACHED, dtype=np.int8)
        least = np.zeros(found.shape)
        determinant_ratios = np.zeros(found.shape)
        endings[found], least[found] = rollout.endings, rollout.least
        determinant_ratios[found] = rollout.determinant_ratios
        return BranchOutcomes(attitudes, joints, endings, determinant_ratios, least, rollout)

    def margins(self, attitudes: Array, branch: int | None) -> Array:
        """Margin that a branch, or the best of all, keeps from attitudes (K, 4); shape (K,)."""
        return np.asarray(self.prospects(attitudes, branch).margins.max(axis=1, initial=0.0))

    def keeps(self, attitudes: Array, branch: int | None) -> npt.NDArray[np.bool_]:
        """Whether a branch, or any, keeps the problem's margin from attitudes (K, 4); (K,)."""
        found = self.prospects(attitudes, branch, stop_at_margin=True)
        return np.asarray(self.problem.margin.is_kept(found.margins).any(axis=1))

    def safe(self, attitudes: Array, branch: int | None) -> npt.NDArray[np.bool_]:
        """Whether they keep it and stay :func:`clear` of all singularities; (K,)."""
        found = self.prospects(attitudes, branch, stop_at_margin=True)
        good = self.problem.margin.is_kept(found.margins) & clear(found.determinant_ratios)
        return np.asarray(good.any(axis=1))


_CLEAR = 0.01


def clear(determinant_ratios: Array) -> npt.NDArray[np.bool_]:
    """Where motions stay clear of singularities, also of those that their measure does not see.

    A motion may pass such a one at any distance. The attitudes from which it is met form surfaces
    that no sampling hits; near them det S* gets small, and that is seen from afar: it is asked to
    stay above a hundredth of its largest magnitude on the way.
    """
    return np.asarray(determinant_ratios > _CLEAR)


_NEGLIGIBLE = 1e-7
"""Share of the system's mass and inertia below which a body has none."""
_BENT = 4
"""The joint of a spherical wrist that its twin bends the other way."""


def has_closed_form(problem: Problem) -> bool:
    """Whether arm branches in space come from a formula, see ``arm_branches``."""
    virtual = VirtualManipulator.of(problem.model)
    formula = virtual.has_elbow_and_spherical_wrist or virtual.has_three_parallel_axes
    return problem.task is Task.POSE and formula


def has_wrist_flipped_branches(problem: Problem) -> bool:
    """Whether branches that differ by the wrist alone share their motion.

    So they do when the wrist is square and the bodies inside it have no mass: turned half about
    the first of its axes, bent the other way and turned back it carries the hand alike, and what
    moves differently is weightless. Branch 2 k + 1 then is the twin of branch 2 k.
    """
    virtual, model = VirtualManipulator.of(problem.model), problem.model
    if problem.task is not Task.POSE or not virtual.has_elbow_and_spherical_wrist:
        return False
    h4, h5, h6 = virtual.axes_at(np.zeros(6))[3:]
    inner = model.bodies[4:6]
    heaviest = max(np.abs(body.inertia).max() for body in model.bodies)
    weightless = all(
        body.mass < _NEGLIGIBLE * model.total_mass
        and np.abs(body.inertia).max() < _NEGLIGIBLE * heaviest
        for body in inner
    )
    return weightless and bool(max(abs(h4 @ h5), abs(h5 @ h6)) < _NEGLIGIBLE)


def _mirrored(rollout: Ensemble, own: Array, twin: Array) -> Ensemble:
    """The rollout of the twins of branches.

    Args:
        rollout: Of K motions.
        own: Their joints at the start, shape (K, 6).
        twin: Joints of their twins at the start, shape (K, 6).
    """
    sign = np.ones(6)
    sign[_BENT] = -1.0
    low = twin + sign * (rollout.lower - own)
    high = twin + sign * (rollout.upper - own)
    return replace(
        rollout,
        joints=frozen(twin + sign * (rollout.joints - own)),
        lower=frozen(np.minimum(low, high)),
        upper=frozen(np.maximum(low, high)),
        evaluations=np.zeros_like(rollout.evaluations),
    )


def _interleaved(even: Ensemble, odd: Ensemble) -> Ensemble:
    """Motions of two rollouts in turns: the first of one, the first of the other, and so on."""
    pairs = {}
    for field in fields(even):
        values = np.stack([getattr(even, field.name), getattr(odd, field.name)], axis=1)
        pairs[field.name] = values.reshape(-1, *values.shape[2:])
        pairs[field.name].setflags(write=False)
    return Ensemble(**pairs)
