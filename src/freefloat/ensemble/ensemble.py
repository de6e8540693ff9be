"""Very many motions at once: the numbers of a problem, and kernels that follow it on all cores.

Every motion is that of :func:`~freefloat.motion.integration.integrate_motion`, to the tolerance
asked for, in about a hundredth of its time; what is kept of it is how it went, not the way it took.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from freefloat.dynamics.kernels.equation import LEVEL, METRIC, MIDDLE, WEIGHT
from freefloat.dynamics.kernels.null_space import ENERGY, MIDDLE_OF_RANGE, SIGMA, WEIGHTED
from freefloat.dynamics.kernels.right_side import Robot
from freefloat.dynamics.kernels.robot_arrays import robot_facts, robot_rows
from freefloat.dynamics.measures import NAMES, arm_axes
from freefloat.dynamics.null_space import middles, weights
from freefloat.dynamics.redundancy import Metric, Redundancy, Toward
from freefloat.ensemble.kernels.integration import (
    EnsembleResult,
    integrate_many,
    make_buffers,
)
from freefloat.ensemble.kernels.steps import TABLEAU
from freefloat.motion.problem import Problem
from freefloat.paths.path import EndEffectorPath
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, whole_number

TOLERANCE = 1e-6
_CELLS = 512
"""Cubics that stand for the path's tangent."""
_THIRDS = (0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0)
_THROUGH_THIRDS = np.linalg.inv(np.vander(_THIRDS, increasing=True))
"""Values at the thirds of an interval as powers of its share, lowest first."""
_CHUNK = 128
"""Motions between two looks at the clock and the keyboard."""


Progress = Callable[[float], None]
"""Called with the fraction done, in [0, 1], during a long computation."""


class EnsembleIntegrator:
    """Integrates many motions of one problem."""

    def __init__(self, problem: Problem, threads: int | None = None) -> None:
        """Prepare the numbers of a problem.

        Args:
            problem: Robot, path and momentum.
            threads: How many cores to use; all this process may when left out.
        """
        cores = len(os.sched_getaffinity(0))
        self.threads = cores if threads is None else whole_number("threads", threads, 1)
        self.problem = problem
        self._robot = _robot(problem)

    def integrate(
        self,
        attitudes: Array,
        joints: Array,
        *,
        momenta: Array | None = None,
        starts: Array | None = None,
        ends: Array | None = None,
        stop_below: float = 0.0,
        tolerance: float = TOLERANCE,
        progress: Progress | None = None,
    ) -> EnsembleResult:
        """Integrate the motions along the path from many states.

        Args:
            attitudes: First ones, unit quaternions x, y, z, w, shape (K, 4).
            joints: First ones, with the end-effector on the path, shape (K, n).
            momenta: Angular momenta to drift with instead of the problem's, shape (K, 3).
            starts: Times to begin at [s], shape (K,); 0 when left out.
            ends: Times to stop at [s], shape (K,); the duration when left out. An end before its
                start retraces a motion.
            stop_below: Give up motions whose measure falls below this magnitude.
            tolerance: Relative and absolute, per step.
            progress: Called with the share done, in [0, 1].
        """
        K, n = joints.shape
        duration = self.problem.path.duration
        states = (
            np.array(attitudes, dtype=float, order="C"),  # copies, for kernels are compiled for
            np.array(joints, dtype=float, order="C"),  # arrays that may be written to
            np.array(
                np.broadcast_to(self.problem.momentum if momenta is None else momenta, (K, 3)),
                dtype=float,
                order="C",
            ),
            np.zeros(K) if starts is None else np.array(starts, dtype=float),
            np.full(K, duration) if ends is None else np.array(ends, dtype=float),
        )
        result = EnsembleResult.empty((K,), n)

        def integrate_chunk(first: int) -> None:
            integrate_many(
                TABLEAU, self._robot, *states, stop_below, tolerance, first, min(first + _CHUNK, K),
                make_buffers(n, len(self._robot.rows)), result,
            )  # fmt: skip

        run_chunks(integrate_chunk, range(0, K, _CHUNK), self.threads, progress)
        return EnsembleResult(*(_frozen(values) for values in result))


def run_chunks(
    work: Callable[[int], None], chunks: range, threads: int, progress: Progress | None = None
) -> None:
    """Do independent pieces of work on several threads; an interruption drops what is not begun."""
    if len(chunks) < 2 or threads == 1:
        for done, chunk in enumerate(chunks):
            work(chunk)
            if progress is not None:
                progress((done + 1) / len(chunks))
        return
    with ThreadPoolExecutor(threads) as pool:
        futures = [pool.submit(work, chunk) for chunk in chunks]
        try:
            for done, future in enumerate(as_completed(futures)):
                future.result()
                if progress is not None:
                    progress((done + 1) / len(futures))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _frozen(values: Any) -> Any:
    values.setflags(write=False)
    return values


def _robot(problem: Problem) -> Robot:
    """A problem as the kernels want it."""
    model, task, path = problem.model, problem.task, problem.path
    name = problem.margin.measure.name
    facts, bodies = robot_facts(model, task), robot_rows(model)
    if name == "arm":
        facts[LEVEL:METRIC] = arm_axes(model, task).ravel()
    if problem.redundancy is not None and not problem.redundancy.plain:
        _choose(problem.redundancy, model, bodies, facts)
    ends = np.append(path.breaks, path.duration)
    pieces = [path.timing.segments[path.timing.segment_at(t)] for t in _middles(ends)]
    law = np.zeros((len(pieces), 2, max(len(piece.orders[0]) for piece in pieces)))
    for number, piece in enumerate(pieces):
        for order in (0, 1):
            coefficients = piece.orders[order]
            law[number, order, law.shape[2] - len(coefficients) :] = coefficients
    return Robot(
        bodies=bodies,
        facts=facts,
        rows=np.array(task.rows, dtype=np.int64),
        measure=NAMES.index(name),
        ends=ends,
        origins=np.array([piece.origin for piece in pieces]),
        spans=np.array([piece.span for piece in pieces]),
        law=law,
        tangents=_tangents(path.path),
        duration=path.duration,
    )


def _middles(ends: Array) -> list[float]:
    """Of intervals that begin at 0 and end at the times given [s]."""
    return [(low + high) / 2.0 for low, high in pairwise([0.0, *ends.tolist()])]


def _tangents(path: EndEffectorPath) -> Array:
    """A path's tangent as cubics in s, see :class:`freefloat.dynamics.kernels.right_side.Robot`.

    On equal intervals through the tangents at their ends; of a path whose derivatives jump, between
    the jumps and through four places in each interval.
    """
    if not len(path.breaks):
        s = np.linspace(0.0, 1.0, _CELLS + 1)
        cubics = CubicSpline(s, [path.tangent(float(place)) for place in s]).c
        return np.ascontiguousarray(cubics.transpose(1, 2, 0))
    cells = []
    for low, high in pairwise([0.0, *path.breaks.tolist(), 1.0]):
        tangent = path.tangent_within(low, high)
        edges = np.linspace(low, high, int(np.ceil(_CELLS * (high - low))) + 1)
        for start, width in zip(edges.tolist(), np.diff(edges).tolist(), strict=False):
            values = [tangent(start + share * width) for share in _THIRDS]
            cubic = _THROUGH_THIRDS @ np.array(values) / width ** np.arange(4.0)[:, None]
            cells.append(np.vstack([cubic[::-1].T, [start, 0.0, 0.0, 0.0]]))
    return np.array(cells)


def _choose(redundancy: Redundancy, model: FreeFloatingModel, bodies: Array, facts: Array) -> None:
    """Tell the kernels what a redundant arm does with its freedom."""
    bodies[1:, WEIGHT], bodies[1:, MIDDLE] = weights(model, redundancy), middles(model)
    metric = ENERGY if redundancy.metric is Metric.ENERGY else WEIGHTED
    codes = {Toward.NONE: 0, Toward.SIGMA: SIGMA, Toward.MIDDLE: MIDDLE_OF_RANGE}
    toward = codes[redundancy.toward]
    facts[METRIC:] = metric, toward, redundancy.gain, redundancy.bound
