"""Integration of many motions of one problem by compiled code on all cores.

Each motion agrees with :func:`~freefloat.motion.integration.integrate_motion` within the
tolerance and takes less than a hundredth of its time; results are summaries, without trajectories.
States at common instants are recorded on panels, as precise motions have them.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.polynomial import chebyshev

from freefloat.concurrency import Progress, available_cores, run_chunks
from freefloat.dynamics.robot_arrays import KernelAxes
from freefloat.ensemble.arrays import kernel_problem, spare_slacks
from freefloat.ensemble.endings import COMPLETED, LIMITED, STEP_TOLERANCE
from freefloat.ensemble.kernels.integration import integrate_many
from freefloat.ensemble.kernels.records import Motions, make_workspace
from freefloat.ensemble.result import EnsembleResult
from freefloat.ensemble.systems import ScaledMotions, Systems
from freefloat.errors import InputError, finite_number, whole_number
from freefloat.motion.margin import ROUNDING
from freefloat.motion.panels import DEGREE, NODES, TO_COEFFICIENTS
from freefloat.motion.pointing import AttitudeLimits
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, BoolArray

_CHUNK = 1024
"""Largest number of motions between two reports of progress or checks for an interruption."""
_FEWEST = 64
"""Smallest number of motions of a thread: at the end of its work, lanes are idle."""
_TOLERANCE = 1e-9
_SLOPES = chebyshev.chebvander(NODES, DEGREE - 1) @ chebyshev.chebder(TO_COEFFICIENTS)
"""Maps values at the nodes of a panel to derivatives by its parameter there, shape (9, 9)."""


class EnsembleIntegrator:
    """Integrator of many motions of one problem."""

    def __init__(
        self,
        problem: Problem,
        threads: int | None = None,
        *,
        tolerance: float = STEP_TOLERANCE,
        limits: AttitudeLimits | None = None,
    ) -> None:
        """Convert a problem to the arrays that the kernels read.

        Args:
            problem: Robot, path and momentum.
            threads: Number of threads; one for each core of this process when left out.
            tolerance: Relative and absolute tolerance of the integration steps, 1e-13 to 1e-2.
            limits: Limits of attitude that motions are compared with. The turn of the spacecraft
                is that since the start of a motion.

        Raises:
            InputError: If the number of threads or the tolerance is not accepted.
        """
        self.threads = whole_number("threads", available_cores() if threads is None else threads, 1)
        self.problem = problem
        self.tolerance = finite_number("tolerance", tolerance, "1e-13 to 1e-2", 1e-13, 1e-2)
        limits = limits or AttitudeLimits()
        # the cache knows limits by identity: integrators without limits share an entry
        self._arrays = kernel_problem(problem, limits if limits.number else None)
        self._axes = KernelAxes.of(problem.model, problem.task)
        self._spares = spare_slacks(limits, self.tolerance)

    def integrate(
        self,
        attitudes: Array,
        joints: Array,
        systems: Systems | None = None,
        *,
        starts: Array | None = None,
        ends: Array | None = None,
        stop_below: float = 0.0,
        stricter: bool = False,
        extremes: bool = False,
        moments: Array | None = None,
        steps: Array | None = None,
        progress: Progress | None = None,
    ) -> EnsembleResult:
        """Integrate the motions along the path from many states.

        Args:
            attitudes: Initial attitudes, unit quaternions x, y, z, w, shape (K, 4).
            joints: Initial joint values, with the end-effector on the path, shape (K, n). Values of
                further arms that move, behind the n of the arm, may be given, too.
            systems: Momenta, drifts and robots; the problem's when left out.
            starts: Initial times [s], shape (K,); 0 when left out.
            ends: Final times [s], shape (K,); the duration when left out. With an end before its
                start a motion is integrated backward.
            stop_below: Stop motions that violate a margin with this threshold.
            stricter: Begin with a tenth of the tolerance, with which motions whose minimum of the
                measure is small relative to its maximum are otherwise integrated again.
            extremes: Look for the largest rates and the extreme joint values between the
                integrator's steps, too, which takes a tenth longer.
            moments: With ``extremes``, where the times of the extreme values [s] are written, shape
                (K, 3 n + 1 + L): of the rate, the smallest and the largest value of each joint,
                of the spacecraft's rate, then of the slacks.
            steps: Array to write the steps of one motion to, see :class:`.records.Motions`.
            progress: Called with the fraction done, in [0, 1].

        Raises:
            InputError: If an array has another shape, a number is not finite, or a time is not on
                the path.
        """
        K, n = len(joints), self.problem.dof
        systems = systems or Systems.of(self.problem)
        robots = None
        if systems.robots is not None:
            self.problem.model.require_supported("robots that differ")
            robots = systems.robots.properties(self.problem)
        duration = self.problem.path.duration
        columns = 3 * n + 1 + len(self._spares)
        if moments is None:
            moments = np.empty((K if extremes else 0, columns))
        motions = Motions(
            self._axes.attitudes(_checked("attitudes", attitudes, (K, 4))),
            _checked("joints", self.problem.solved_joints(np.asarray(joints)), (K, n)),
            self._axes.systems(systems.columns(K)),
            robots,
            _checked("starts", np.zeros(K) if starts is None else starts, (K,), duration),
            _checked("ends", np.full(K, duration) if ends is None else ends, (K,), duration),
            stop_below * (1.0 - ROUNDING),
            stricter,
            extremes,
            moments,
            np.empty((0, 1)) if steps is None else steps,
        )
        properties, paths = 0 if robots is None else robots.shape[1], len(self.problem.path.by_arm)
        sizes = n, self._arrays.robot.m, len(self._spares), properties, paths
        result = EnsembleResult.empty((K,), n, len(self._spares))
        chunk = min(_CHUNK, max(-(-K // self.threads), _FEWEST))

        def integrate_chunk(first: int) -> None:
            part = first, min(first + chunk, K), self.tolerance
            integrate_many(self._arrays, motions, *part, make_workspace(*sizes), result)

        run_chunks(integrate_chunk, range(0, K, chunk), self.threads, progress)
        result.attitudes[:] = self._axes.attitudes(result.attitudes, back=True)
        if steps is not None:
            taken = steps[1 : 1 + int(steps[0, 0])]
            for part in (slice(1, 5), slice(5 + n, 9 + n)):  # attitudes and their rates
                taken[:, part] = self._axes.attitudes(taken[:, part], back=True)
        violated = (result.slacks < self._spares).any(axis=1) & (result.endings == COMPLETED)
        result.endings[violated] = LIMITED
        for array in result:
            array.setflags(write=False)
        return result


def _checked(key: str, values: Array, shape: tuple[int, ...], latest: float | None = None) -> Array:
    """A copy for the kernels, which check nothing."""
    array = np.array(values, dtype=float, order="C")
    if array.shape != shape:
        raise InputError(key, f"shape {array.shape} was given", f"shape {shape}")
    if not np.isfinite(array).all():
        raise InputError(key, "a number is not finite", "finite numbers")
    if latest is not None and ((array < 0.0) | (array > latest)).any():
        problem = f"times from {array.min():g} to {array.max():g} s were given"
        raise InputError(key, problem, f"times from 0 to {latest:g} s")
    return array


@dataclass(frozen=True, eq=False)
class RecordedMotions:
    """Motions that stand for disturbed ones, at the nodes of P panels of 9.

    Attributes:
        disturbed: The motions.
        times: Times of the nodes [s], shape (8 P + 1,).
        attitudes: Attitudes of the spacecraft there, shape (K, 8 P + 1, 4).
        joints: Joint values there, shape (K, 8 P + 1, n).
        completed: Which motions reach the last node, shape (K,); others are constant from the last
            node that they reach on.
    """

    disturbed: ScaledMotions = field(repr=False)
    times: Array = field(repr=False)
    attitudes: Array = field(repr=False)
    joints: Array = field(repr=False)
    completed: BoolArray = field(repr=False)

    @classmethod
    def of(
        cls, disturbed: ScaledMotions, attitudes: Array, joints: Array, panels: int, threads: int
    ) -> RecordedMotions:
        """Integrate motions from node to node.

        Args:
            disturbed: The motions.
            attitudes: Initial attitudes, shape (K, 4).
            joints: Initial joint values, shape (K, n).
            panels: Least number of panels; every segment of the time law has its own.
            threads: Number of threads.
        """
        problem, count = disturbed.problem, len(joints)
        times = _nodes(np.append(problem.path.breaks, problem.path.duration), panels)
        integrator = EnsembleIntegrator(problem, threads, tolerance=_TOLERANCE)
        states = [(attitudes, joints)]
        completed = np.ones(count, dtype=bool)
        for start, end in zip(times[:-1].tolist(), times[1:].tolist(), strict=True):
            before = states[-1]
            result = integrator.integrate(
                *before, disturbed.systems, starts=np.full(count, start), ends=np.full(count, end)
            )
            completed &= result.endings == COMPLETED
            reached = completed[:, None]
            after = zip((result.attitudes, result.joints), before, strict=True)
            q, joint_values = (np.where(reached, new, old) for new, old in after)
            states.append((q, joint_values))
        q, joint_values = (np.stack(values, axis=1) for values in zip(*states, strict=True))
        return cls(disturbed, times, q, joint_values, completed)

    @property
    def panel_times(self) -> Array:
        """Times of the nodes of each panel along the disturbed motions [s], shape (K, P, 9)."""
        return (
            self.disturbed.stretches[:, None, None] * in_panels(self.times[None, :, None])[..., 0]
        )

    def rates(self, values: Array) -> Array:
        """Derivatives by time, along the disturbed motions, of values (K, P, 9, c) in panels."""
        lengths = np.ptp(self.panel_times, axis=2)
        return np.asarray(_SLOPES @ values * (2.0 / lengths)[..., None, None])


def in_panels(values: Array) -> Array:
    """Values at nodes (K, 8 P + 1, c) by panel, neighbours of which share a node, (K, P, 9, c)."""
    nodes = np.arange(0, values.shape[1] - 1, DEGREE)[:, None] + np.arange(DEGREE + 1)
    return np.asarray(values[:, nodes])


def _nodes(ends: Array, panels: int) -> Array:
    """Times of the nodes of at least so many panels of segments that end at some times."""
    edges = [np.zeros(1)]
    for start, end in zip([0.0, *ends[:-1]], ends, strict=True):
        number = max(1, int(np.ceil(panels * (end - start) / ends[-1])))
        edges.append(np.linspace(start, end, number + 1)[1:])
    grid = np.concatenate(edges)
    inside = (NODES[1:] + 1.0) / 2.0
    return np.append(0.0, (grid[:-1, None] + np.diff(grid)[:, None] * inside).ravel())
