"""Integration of many motions of one problem by compiled code on all cores.

Each motion agrees with that of :func:`~freefloat.motion.integration.integrate_motion` within the
tolerance and takes less than a hundredth of its time; results are summaries, without trajectories.
"""

from __future__ import annotations

import numpy as np

from freefloat.concurrency import Progress, available_cores, run_chunks
from freefloat.dynamics.robot_arrays import KernelAxes
from freefloat.ensemble.arrays import kernel_problem, spare_slacks
from freefloat.ensemble.endings import COMPLETED, LIMITED, STEP_TOLERANCE
from freefloat.ensemble.kernels.integration import integrate_many
from freefloat.ensemble.kernels.records import Motions, make_workspace
from freefloat.ensemble.result import EnsembleResult
from freefloat.ensemble.systems import Systems
from freefloat.errors import InputError, finite_number, whole_number
from freefloat.motion.margin import ROUNDING
from freefloat.motion.pointing import AttitudeLimits
from freefloat.motion.problem import Problem
from freefloat.so3 import Array

_CHUNK = 1024
"""Largest number of motions between two reports of progress or checks for an interruption."""
_FEWEST = 64
"""Smallest number of motions of a thread: at the end of its work, lanes are idle."""


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
            joints: Initial joint values, with the end-effector on the path, shape (K, n). Those of
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
            steps: Of one motion, where its steps are written, see :class:`.records.Motions`.
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
