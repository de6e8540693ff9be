"""Integration of many motions of one problem by compiled code on all cores.

Each motion agrees with that of :func:`~freefloat.motion.integration.integrate_motion` within the
tolerance and takes about a hundredth of its time; results are summaries, without trajectories.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from freefloat.concurrency import Progress, available_cores, run_chunks
from freefloat.dynamics.measures import NAMES
from freefloat.dynamics.redundancy import Metric, Toward, joint_weights, range_centres
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ensemble.kernels.integration import COMPLETED, UNREACHED, integrate_many
from freefloat.ensemble.kernels.lanes import WIDTH
from freefloat.ensemble.kernels.null_space import ENERGY, MIDDLE_OF_RANGE, SIGMA, WEIGHTED
from freefloat.ensemble.kernels.records import (
    Course,
    Measure,
    Motions,
    NullSpace,
    Robot,
    make_workspace,
)
from freefloat.ensemble.kernels.records import Problem as KernelProblem
from freefloat.ensemble.kernels.steps import TABLEAU
from freefloat.ensemble.link_frames import link_frames
from freefloat.errors import whole_number
from freefloat.motion.margin import keeps_threshold
from freefloat.motion.problem import Problem
from freefloat.paths.path import EndEffectorPath
from freefloat.so3 import Array, IntArray

STEP_TOLERANCE = 1e-6
"""Relative and absolute tolerance of integration steps, by default."""
_CELLS, _TANGENT_ERROR = (1, 32, 256), 1e-11
"""Numbers of cubics that approximate the path's tangent, and their relative error."""
_NODES = np.array([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0, 0.5])
_THROUGH_NODES = np.linalg.inv(np.vander(_NODES[:4], increasing=True))
"""Maps values at the first four nodes to the cubic's coefficients, lowest power first."""
_ANGLES, _NEGLIGIBLE = 12, 1e-13
"""Values of a joint for the measure ``arm``; relative size of coefficients that are rounding."""
_CHUNK = 1024
"""Largest number of motions between two reports of progress or checks for an interruption."""


class EnsembleResult(NamedTuple):
    """Results of K motions; in tables of arm branches the leading shape is (K, B) instead.

    Attributes:
        endings: 0 completed, 1 singular, 2 margin violated, 3 step limit reached, shape (K,); in
            tables -1 where the arm branch does not exist.
        ended_at: Final times [s], shape (K,).
        minimum: Minimum magnitude of the measure, zero where it changes sign, shape (K,).
        minimum_at: Times of the minimum [s], shape (K,).
        attitudes: Final attitudes, quaternions x, y, z, w, shape (K, 4).
        joints: Final joint values [rad or m], shape (K, n).
        rates: Largest magnitudes of the joint rates at the integrator's steps, shape (K, n).
        lower: Smallest joint values at the steps, shape (K, n).
        upper: Largest joint values at the steps, shape (K, n).
        determinant_ratios: Smallest over largest magnitude of det S* at the steps; small near any
            singularity, also one at which the measure does not vanish, shape (K,).
        evaluations: Number of evaluations of (4), shape (K,).
    """

    endings: npt.NDArray[np.int8]
    ended_at: Array
    minimum: Array
    minimum_at: Array
    attitudes: Array
    joints: Array
    rates: Array
    lower: Array
    upper: Array
    determinant_ratios: Array
    evaluations: IntArray

    @classmethod
    def empty(cls, shape: tuple[int, ...], n: int) -> EnsembleResult:
        """Arrays for results of motions of n joints, with the ending of missing branches."""
        times, minimum_at = np.full((2, *shape), np.nan)
        minimum, determinant_ratios = np.zeros((2, *shape))
        joints, rates, lower, upper = np.full((4, *shape, n), np.nan)
        return cls(
            np.full(shape, UNREACHED, np.int8), times, minimum, minimum_at,
            np.full((*shape, 4), np.nan), joints, rates, lower, upper, determinant_ratios,
            np.zeros(shape, np.int64),
        )  # fmt: skip

    def columns(self, numbers: IntArray) -> EnsembleResult:
        """The results of some columns of a table."""
        return EnsembleResult._make(values[:, numbers] for values in self)

    def assign(self, chosen: npt.NDArray[np.bool_], motions: EnsembleResult) -> None:
        """Write the results of motions where they are chosen, in place."""
        for name in self._fields:
            getattr(self, name)[chosen] = getattr(motions, name)

    def keeps(self, margin: float) -> npt.NDArray[np.bool_]:
        """Which motions complete and keep a margin, shape (K,)."""
        return np.asarray((self.endings == COMPLETED) & keeps_threshold(self.minimum, margin))


class EnsembleIntegrator:
    """Integrator of many motions of one problem."""

    def __init__(
        self, problem: Problem, threads: int | None = None, *, tolerance: float = STEP_TOLERANCE
    ) -> None:
        """Convert a problem to the arrays that the kernels read.

        Args:
            problem: Robot, path and momentum.
            threads: Number of threads; one for each core of this process when left out.
            tolerance: Relative and absolute tolerance of the integration steps.
        """
        self.threads = whole_number("threads", available_cores() if threads is None else threads, 1)
        self.problem, self.tolerance = problem, tolerance
        self._arrays = _kernel_problem(problem)

    def integrate(
        self,
        attitudes: Array,
        joints: Array,
        *,
        momenta: Array | None = None,
        starts: Array | None = None,
        ends: Array | None = None,
        stop_below: float = 0.0,
        progress: Progress | None = None,
    ) -> EnsembleResult:
        """Integrate the motions along the path from many states.

        Args:
            attitudes: Initial attitudes, unit quaternions x, y, z, w, shape (K, 4).
            joints: Initial joint values, with the end-effector on the path, shape (K, n).
            momenta: Angular momenta [N m s], shape (K, 3); the problem's when left out.
            starts: Initial times [s], shape (K,); 0 when left out.
            ends: Final times [s], shape (K,); the duration when left out. With an end before its
                start a motion is integrated backward.
            stop_below: Stop motions whose measure falls below this magnitude.
            progress: Called with the fraction done, in [0, 1].
        """
        K, n = joints.shape
        momenta = self.problem.momentum if momenta is None else momenta
        starts = np.zeros(K) if starts is None else starts
        ends = np.full(K, self.problem.path.duration) if ends is None else ends
        result = EnsembleResult.empty((K,), n)

        def copied(array: Array) -> Array:  # the kernels are compiled for writable arrays
            return np.array(array, dtype=float, order="C")

        motions = Motions(
            copied(attitudes), copied(joints), copied(np.broadcast_to(momenta, (K, 3))),
            copied(starts), copied(ends), float(stop_below),
        )  # fmt: skip
        chunk = min(_CHUNK, max(-(-K // (4 * self.threads)), 4 * WIDTH))

        def integrate_chunk(first: int) -> None:
            integrate_many(
                self._arrays, motions, first, min(first + chunk, K), self.tolerance,
                make_workspace(n, self._arrays.robot.m), result,
            )  # fmt: skip

        run_chunks(integrate_chunk, range(0, K, chunk), self.threads, progress)
        for array in result:
            array.setflags(write=False)
        return result


def _kernel_problem(problem: Problem) -> KernelProblem:
    """The arrays that the kernels read of a problem."""
    model, task = problem.model, problem.task
    frames = link_frames(model)
    robot = Robot(
        frames.bodies, frames.base, frames.tool, np.array(task.rows, dtype=float), model.dof,
        len(task.rows), task.planar, model.total_mass,
    )  # fmt: skip
    name = problem.margin.measure.name
    polynomial = _polynomial(problem) if name == "arm" else np.zeros((0, 4))
    reach = VirtualManipulator.of(model).reach
    measure = Measure(NAMES.index(name), reach, len(polynomial), polynomial)
    return KernelProblem(robot, _course(problem), measure, _null_space(problem), TABLEAU)


def _null_space(problem: Problem) -> NullSpace | None:
    redundancy = problem.redundancy
    if redundancy is None or redundancy.minimum_norm:
        return None
    centres = range_centres(problem.model)
    toward = {Toward.NONE: 0, Toward.MANIPULABILITY: SIGMA, Toward.MIDDLE: MIDDLE_OF_RANGE}
    return NullSpace(
        ENERGY if redundancy.metric is Metric.ENERGY else WEIGHTED, toward[redundancy.toward],
        float(redundancy.gain), float(redundancy.bound),
        np.array(joint_weights(problem.model, redundancy), dtype=float),
        np.nan_to_num(centres), np.isfinite(centres).astype(float),
    )  # fmt: skip


def _polynomial(problem: Problem) -> Array:
    """The measure ``arm`` as a trigonometric polynomial of the second and third joints.

    Returns:
        Rows k, l, a, b of the terms a cos(k q2 + l q3) + b sin(k q2 + l q3).
    """
    measure, angles = problem.margin.measure, 2.0 * np.pi * np.arange(_ANGLES) / _ANGLES
    values = np.array([
        [measure(np.array([0.0, q2, q3, 0.0, np.pi / 2.0, 0.0])) for q3 in angles] for q2 in angles
    ])  # fmt: skip
    coefficients = np.fft.fft2(values) / _ANGLES**2
    coefficients[np.abs(coefficients) < _NEGLIGIBLE * np.abs(coefficients).max()] = 0.0
    terms = []
    for i, j in zip(*np.nonzero(coefficients), strict=True):
        pair = tuple(int(index - _ANGLES * (2 * index > _ANGLES)) for index in (i, j))
        if pair >= (0, 0):  # the others are the conjugates of these
            coefficient = (1.0 if pair == (0, 0) else 2.0) * coefficients[i, j]
            terms.append([*pair, coefficient.real, -coefficient.imag])
    return np.array(terms)


def _course(problem: Problem) -> Course:
    """Path and timing as arrays."""
    path = problem.path
    ends = np.append(path.breaks, path.duration)
    starts = np.append(0.0, ends[:-1])
    segments = [
        path.timing.segments[path.timing.segment_at(t)] for t in ((starts + ends) / 2.0).tolist()
    ]
    degree = max(len(segment.orders[0]) for segment in segments) - 1
    rows: list[list[float]] = []
    cells: list[Array] = []
    for segment, start, end in zip(segments, starts.tolist(), ends.tolist(), strict=True):
        low, high = segment(start, 0), segment(end, 0)
        pieces = _tangents(path.path, low, high)
        density = len(pieces) / (high - low)
        law = [[0.0] * (degree + 1 - len(order)) + list(order) for order in segment.orders[:2]]
        counts = (float(sum(len(entry) for entry in cells)), float(len(pieces)))
        place = (end, segment.origin, 1.0 / segment.span, low, density)
        rows.append([*place, *counts, *law[0], *law[1]])
        cells.append(pieces)
    stacked = np.concatenate(cells)
    return Course(path.duration, np.array(rows), len(rows), degree, stacked, len(stacked) == 1)


def _tangents(path: EndEffectorPath, low: float, high: float) -> Array:
    """A path's tangent between two values of s as cubics of the fraction of equal intervals.

    Returns:
        Coefficients, highest power first, shape (cells, 6, 4).
    """
    tangent = path.tangent_within(low, high)
    for number in _CELLS:
        width = (high - low) / number
        nodes = low + width * (np.arange(number)[:, None] + _NODES)
        values = np.array([tangent(s) for s in nodes.ravel().tolist()]).reshape(number, 5, 6)
        cubics = np.einsum("pk,nki->nip", _THROUGH_NODES, values[:, :4])[..., ::-1]
        error = values[:, 4] - cubics @ (0.5 ** np.arange(3, -1, -1))
        if np.abs(error).max() <= _TANGENT_ERROR * np.abs(values).max():
            break
    return np.ascontiguousarray(cubics)
