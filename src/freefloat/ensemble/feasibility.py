"""Feasibility of many initial attitudes at once, arm branch by arm branch."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from freefloat.attitude_grids import attitude_grid
from freefloat.concurrency import Progress, require_memory, run_chunks
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ensemble.endings import COMPLETED, STEP_TOLERANCE
from freefloat.ensemble.integrators import Integrator, integrator_for
from freefloat.ensemble.result import REGULAR_RATIO, BranchResults, EnsembleResult
from freefloat.ik.branches import ClosedForm, closed_form
from freefloat.motion.margin import keeps_threshold
from freefloat.motion.pointing import AttitudeLimits
from freefloat.motion.problem import Problem, require_problem
from freefloat.so3 import Array, BoolArray, IntArray

_NEGLIGIBLE = 1e-7
"""Fraction of the system's mass and inertia below which a body counts as massless."""
_WRIST_BODIES = 4, 5
"""The bodies that wrist-flipped branches place differently."""
_FLIPPED_JOINT = 4
"""The joint of a spherical wrist whose sign differs between wrist-flipped branches."""
_REDUCTION = 4
"""Reduction of the number of attitudes in searches whose arm branches have no closed form."""
_AMPLE = 1e9
"""Largest multiple of a margin, which may be zero."""
_MOST, _FEWEST = 512, 64
"""Most attitudes for whose branches a thread looks at once, and fewest of numerical searches."""
_ATTITUDE_SIZE, _MOTION_SIZE, _JOINT_SIZE = 500, 200, 40
"""Memory of a map for an attitude, for each of its motions, and for each joint of a motion, with
the copies made of it [bytes]."""
Branch = int | IntArray | None
"""Number of an arm branch, or one for each attitude, shape (K,); None for the best of all."""


class FeasibilityEvaluator:
    """Integrator of the motions from many attitudes, which decides which keep the margin.

    Arm branches without closed form, and the many motions of two arms, take far longer than the
    motions of one arm; searches then divide their numbers of attitudes by ``sample_reduction``.
    """

    def __init__(
        self,
        problem: Problem,
        threads: int | None = None,
        *,
        tolerance: float = STEP_TOLERANCE,
        limits: AttitudeLimits | None = None,
    ) -> None:
        """Prepare a problem.

        Args:
            problem: Robot, path, momentum and margin.
            threads: Number of threads; one for each core of this process when left out.
            tolerance: Relative and absolute tolerance of the integration steps.
            limits: Limits of attitude; motions that violate them count as infeasible.

        Raises:
            InputError: If ``problem`` is not a Problem.
        """
        require_problem(problem)
        self.problem = problem
        self.limits = limits or AttitudeLimits()
        self.integrator, self._single = (
            integrator_for(problem, number, tolerance=tolerance, limits=self.limits)
            for number in (threads, 1)
        )
        bodies = [problem.model.link_places[limit.body][0] for limit in self.limits.pointing]
        on_wrist = not set(bodies).isdisjoint(_WRIST_BODIES)  # whose axes wrist flips move
        self.wrist_flipped = has_wrist_flipped_branches(problem) and not on_wrist
        exact = closed_form(problem.model_at(), problem.task)
        self.sample_reduction, self._fewest = (1, _MOST) if exact else (_REDUCTION, _FEWEST)

    @property
    def threads(self) -> int:
        """Number of threads."""
        return self.integrator.threads

    def require_memory(self, samples: int) -> None:
        """Raise an InputError if motions from so many attitudes need too much memory."""
        _, branches, n = self.problem.many_branches(attitude_grid(1)).joints.shape
        require_memory(
            "samples", samples, _ATTITUDE_SIZE + branches * (_MOTION_SIZE + _JOINT_SIZE * n)
        )

    def evaluate(
        self,
        attitudes: Array,
        branch: Branch = None,
        *,
        stop_at_margin: bool = False,
        extremes: bool = False,
        progress: Progress | None = None,
    ) -> BranchResults:
        """Integrate the motions along the path from many attitudes.

        Wrist-flipped branches 2 k and 2 k + 1 have the same motion: where both exist,
        the motion of 2 k is integrated and the other derived from it.

        Args:
            attitudes: Unit quaternions x, y, z, w, shape (K, 4).
            branch: Only the arm branch with this number, or a number for each attitude; all when
                left out.
            stop_at_margin: Stop motions that violate the margin.
            extremes: As of ``EnsembleIntegrator.integrate``.
            progress: Called with the fraction done, in [0, 1].
        """
        count = len(attitudes)
        size = min(_MOST, max(-(-count // self.threads), self._fewest))
        threshold = self.problem.margin.threshold if stop_at_margin else 0.0
        parts: dict[int, BranchResults] = {}

        def evaluate_chunk(first: int) -> None:
            few = slice(first, first + size)
            own = branch[few] if isinstance(branch, np.ndarray) else branch
            parts[first] = self._evaluated(attitudes[few], own, threshold, extremes, self._single)

        if count <= size:
            return self._evaluated(
                attitudes, branch, threshold, extremes, self.integrator, progress
            )
        run_chunks(evaluate_chunk, range(0, count, size), self.threads, progress)
        first, *others = (parts[number] for number in sorted(parts))
        return first.and_others(*others)

    def _evaluated(
        self, attitudes: Array, branch: Branch, threshold: float, extremes: bool,
        integrator: Integrator, progress: Progress | None = None,
    ) -> BranchResults:  # fmt: skip
        """The results of :meth:`evaluate` by an integrator, motions being stopped at a margin."""
        branches = self.problem.many_branches(attitudes, branch=branch)
        joints, exist = branches.joints, branches.exist
        count, most = exist.shape
        every = np.arange(most)[None]
        if branch is not None:
            every = np.atleast_1d(branch)[:, None]
            every = every[:, every[0] < most]
        rows, columns = np.arange(count)[:, None], np.broadcast_to(every, (count, every.shape[1]))
        sources = columns
        if self.wrist_flipped:
            both = np.repeat(exist[:, ::2] & exist[:, 1::2], 2, axis=1)
            sources = columns - columns % 2 * both[rows, columns]
        own, starts, derived = joints[rows, columns], joints[rows, sources], sources != columns
        chosen = exist[rows, sources] & (~derived if branch is None else True)
        result = integrator.integrate(
            attitudes[np.nonzero(chosen)[0]], starts[chosen], stop_below=threshold,
            extremes=extremes, progress=progress,
        )  # fmt: skip
        table = EnsembleResult.empty(columns.shape, joints.shape[2], self.limits.number)
        table.assign(chosen, result)
        if derived.any():
            if branch is None:
                table = EnsembleResult._make(values[rows, sources] for values in table)
            _flip_wrists(table, derived, starts, own)
        return BranchResults(attitudes, own, table)

    def margins(self, attitudes: Array, branch: Branch) -> Array:
        """Minimum margin along a branch, or the largest of all branches, shape (K,)."""
        motions = self.motions(attitudes, branch, stop_at_margin=False)
        margins = np.where(motions.endings == COMPLETED, motions.minimum, 0.0)
        return np.asarray(margins.max(axis=1, initial=0.0))

    def largest(
        self, attitudes: Array, branch: Branch, merit: Callable[[Array, EnsembleResult], Array]
    ) -> Array:
        """The merit of the motion along a branch, or the largest of all branches, shape (K,)."""
        motions = self.motions(attitudes, branch, stop_at_margin=False)
        return np.asarray(merit(attitudes, motions).max(axis=1, initial=-np.inf))

    def keeps(self, attitudes: Array, branch: Branch, excess: float = 0.0) -> npt.NDArray[np.bool_]:
        """Whether a branch, or any, keeps the problem's margin and a fraction more, shape (K,)."""
        motions = self.motions(attitudes, branch)
        return np.asarray(motions.keeps(self.problem.margin.threshold * (1.0 + excess)).any(axis=1))

    def regular(self, attitudes: Array, branch: Branch) -> npt.NDArray[np.bool_]:
        """Whether a branch, or any, keeps the margin and avoids all singularities, shape (K,)."""
        return is_kept(self.regularity(attitudes, branch))

    def regularity(self, attitudes: Array, branch: Branch) -> Array:
        """The :func:`regularity` of a branch, or of the best of any, shape (K, 2)."""
        motions = self.motions(attitudes, branch)
        values = regularity(motions, self.problem.margin.threshold)
        values = np.pad(values, ((0, 0), (0, 1), (0, 0)))  # there may be no branch
        best = values.min(axis=2).argmax(axis=1)
        return np.asarray(values[np.arange(len(values)), best])

    def motions(
        self, attitudes: Array, branch: Branch, *, stop_at_margin: bool = True
    ) -> EnsembleResult:
        """Results of the motions of all arm branches, shape (K, B), or of a branch each, (K, 1)."""
        return self.evaluate(attitudes, branch, stop_at_margin=stop_at_margin).motions


def regularity(motions: EnsembleResult, threshold: float) -> Array:
    """Minimum margin and determinant ratio, each over the smallest accepted, shape (..., 2).

    Both are zero for motions that end early. Motions with ones or more, see :func:`is_kept`, keep
    the margin and avoid all singularities: the rule of robust radii and tolerances.
    """
    with np.errstate(over="ignore"):
        margins = motions.minimum / max(threshold, np.finfo(float).tiny)
    margins = np.minimum(margins, _AMPLE)
    values = np.stack([margins, motions.determinant_ratios / REGULAR_RATIO], axis=-1)
    return np.asarray(np.where((motions.endings == COMPLETED)[..., None], values, 0.0))


def is_kept(values: Array) -> npt.NDArray[np.bool_]:
    """Which motions, by their :func:`regularity` (..., 2), keep the rule, shape (...)."""
    return keeps_threshold(values.min(axis=-1), 1.0)


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


def _flip_wrists(
    table: EnsembleResult, derived: BoolArray, integrated: Array, flipped: Array
) -> None:
    """Replace results of branches 2 k by results of their wrist-flipped branches, in place.

    Args:
        table: Results, arrays of leading shape (K, B).
        derived: Which are changed, shape (K, B).
        integrated: Initial joint values of the integrated branches, shape (K, B, 6).
        flipped: Initial joint values of the branches of the columns, shape (K, B, 6).
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
