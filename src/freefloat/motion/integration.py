"""Integration of (8) along its own arc length.

Near a dynamic singularity the rates by time grow without bound, yet the curve of (time, attitude,
joints) stays smooth; the singularity is the point of its largest time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import scipy

from freefloat.dynamics.generalized_jacobian import generalized_determinant, generalized_jacobian
from freefloat.dynamics.redundancy import SINGULAR_SPEED, SPINNING_SPEED
from freefloat.dynamics.tasks import Task
from freefloat.errors import InputError, IntegrationError, finite_number
from freefloat.motion.extrema import first_crossing
from freefloat.motion.law import PathLaw
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.panels import NODES
from freefloat.motion.problem import Prescription, Problem, require_problem
from freefloat.motion.residuals import path_errors
from freefloat.so3 import Array

Dense = Callable[[npt.ArrayLike], Array]
"""The curve inside a step, by its arc length."""
_TIME_UNITS = 10.0
"""Length of the time axis, comparable with radians and metres."""
_STALLED = 0.1 * _TIME_UNITS / SINGULAR_SPEED
"""Pace of time per arc length below which a redundant arm moves along a singularity. The small
steps near one allow ten times the speed at which the coarse steps of an ensemble end."""
_LONGEST_STEP = 1.0
_MAX_STEPS = 20_000
_FINEST, _ROUGHEST = 1e-13, 1e-2
"""Accepted tolerances: finer ones are below rounding errors, rougher ones useless."""
_RANK_LOST = 1e-9
"""A start is singular when S*'s smallest singular value is below this fraction of its largest."""
_ON_PATH = 1e-6
"""Largest error of the end-effector at the start [m, rad]."""


def integrate_motion(
    problem: Problem,
    attitude: npt.ArrayLike,
    joints: npt.ArrayLike,
    *,
    start: float = 0.0,
    end: float | None = None,
    stop_at_margin: bool = False,
    tolerance: float = 1e-10,
) -> Motion:
    """Integrate the motion along the path from an attitude and an arm configuration.

    The motion ends where the path does, or exactly where the arm becomes dynamically singular:
    where det S* changes sign or the rates by time grow beyond all bounds. The motion of a redundant
    arm also ends at the first step in which time practically stands still.

    Args:
        problem: Robot, path and momentum.
        attitude: Attitude of the spacecraft at ``start``, quaternion x, y, z, w.
        joints: Joint values at ``start``, shape (n,); the end-effector must be on the path.
        start: Time at which to begin [s].
        end: Time at which to stop [s], by default the duration. One before ``start`` retraces the
            motion that leads to ``start``: the paper's reverse motion with -h (Appendix A).
        stop_at_margin: End where the measure falls below the margin.
        tolerance: Relative and absolute, of the integrator, per step; from 1e-13 to 1e-2.

    Raises:
        InputError: If the end-effector is not on the path at ``start``, or a time or the tolerance
            is not accepted.
        IntegrationError: If the integrator fails for a reason other than a singularity.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> joints = problem.branches([0.0, 0.0, 0.0, 1.0])[0].joints
        >>> ff.integrate_motion(problem, [0.0, 0.0, 0.0, 1.0], joints).completed
        True
    """
    require_problem(problem)
    accepted = f"a number from {_FINEST:g} to {_ROUGHEST:g}"
    tolerance = finite_number("tolerance", tolerance, accepted, _FINEST, _ROUGHEST)
    end = problem.path.duration if end is None else end
    first = _first_node(problem, attitude, joints, start, end)
    motion = motion_from(problem, first, end, tolerance)
    if motion.completed and abs(end - start) < problem.path.duration:
        motion = replace(motion, ending=Ending.PART)
    if stop_at_margin and problem.margin.threshold:
        motion = _cut(motion, problem.margin.measure, problem.margin.threshold, Ending.MARGIN)
    return motion


def motion_from(problem: Problem, node: Array, end: float, tolerance: float) -> Motion:
    """The motion from time, attitude and joints (5 + n,), which are not checked, to a time [s].

    Raises:
        IntegrationError: If the integrator fails for a reason other than a singularity.
    """
    rows, ending = _integrate(problem, ArcFlow(problem), node, end, tolerance)
    rows[:, 5:] = problem.joints_at(rows[:, 0], rows[:, 5:])
    motion = Motion(PathLaw(problem), ending, rows[:, 0], rows[:, 1:5], rows[:, 5:])
    if problem.redundant:
        return motion
    determinant = partial(generalized_determinant, problem.model, task=problem.task)
    return _cut(motion, determinant, 0.0, Ending.SINGULAR)  # det S* has a sign


def _first_node(
    problem: Problem, attitude: npt.ArrayLike, joints: npt.ArrayLike, start: float, end: float
) -> Array:
    """Time, attitude and joints of a checked start, shape (5 + n,)."""
    attitude = problem.attitude(attitude)
    values = problem.model.joint_vector(joints)
    duration = problem.path.duration
    for key, time in (("start", start), ("end", end)):
        finite_number(key, time, f"a time from 0 to {duration:g} s", 0.0, duration)
    joints = problem.joints_at(start, values)
    if len(values) == len(joints):
        errors = np.abs(values - joints)
        if errors[k := int(errors.argmax())] > _ON_PATH:
            of_joint = f"{problem.model.joint_names[k]} is {errors[k]:.3g}"
            problem_text = f"{of_joint} off the joint curve of its arm at t = {start:g} s"
            raise InputError("joints", problem_text, "the joints of the arms that follow paths")
    offset, angle = path_errors(problem, np.array([start]), attitude[None], joints[None])[0]
    if max(offset, angle) > _ON_PATH:
        away = f"the end-effector is {offset:.3g} m and {angle:.3g} rad off the path"
        accepted = "joints that meet the path; Problem.branches(attitude) lists them"
        raise InputError("joints", f"{away} at t = {start:g} s", accepted)
    return np.concatenate([[start], attitude, joints])


def _cut(motion: Motion, f: Callable[[Array], Array], level: float, ending: Ending) -> Motion:
    """The motion up to where a function of the joints changes sign or falls below a level."""
    u = first_crossing(motion, f, level)
    return motion if u is None else motion.cut(u, ending)


@np.errstate(under="ignore")  # of SciPy's shortest step at time zero
def _integrate(
    problem: Problem, flow: ArcFlow, row: Array, end: float, tolerance: float
) -> tuple[Array, Ending]:
    """Nodes (time, attitude, joints) from a first one up to a time or a singularity."""
    start = float(row[0])
    S = generalized_jacobian(problem.model, row[5:], problem.task)
    values = np.linalg.svd(S, compute_uv=False)
    if values[-1] < _RANK_LOST * values[0]:
        return row[None], Ending.SINGULAR
    if start == end:
        return row[None], Ending.COMPLETED
    breaks, (low, high) = problem.breaks, sorted((start, end))
    direction = int(np.sign(end - start))
    between = breaks[(breaks > low) & (breaks < high)][::direction]
    times = [start, *between.tolist(), end]
    panels = [row[None]]
    reference = np.zeros(len(row))
    reference[0] = direction
    stepper = _Stepper(flow, tolerance, reference)
    for begin, until in pairwise(times):
        prescribed = problem.prescribed_between(begin, until)
        for panel, singular in stepper.panels(panels[-1][-1], prescribed, until):
            panels.append(panel[1:])
            if singular:
                return np.vstack(panels), Ending.SINGULAR
        panels[-1][-1, 0] = until
    return np.vstack(panels), Ending.COMPLETED


class ArcFlow:
    """The unit tangent of the curve (time, attitude, joints) along which (8) moves the system.

    Attributes:
        unit: Unit of time along the curve [s].
        stalled: Pace of time per arc length at and below which rates by time have no bound.
    """

    def __init__(self, problem: Problem) -> None:
        self.unit = problem.path.duration / _TIME_UNITS
        self.stalled = 0.0
        if problem.redundant:
            pointing = problem.task is Task.POINTING
            self.stalled = _TIME_UNITS / SPINNING_SPEED if pointing else _STALLED
        self._solver = problem.resolved_rate_solver()
        self._arm = slice(5, 5 + problem.dof)

    def __call__(self, y: Array, prescribed: Prescription, reference: Array) -> Array:
        """The tangent at a point (5 + n,) of the curve, whose attitude may have any length.

        It is on the side of the last one, ``reference``, and so stays continuous across a
        singularity, where time reverses.
        """
        t = float(y[0]) * self.unit
        twist, speed, *further = prescribed(t)
        attitude = y[1:5]
        attitude = attitude / math.sqrt(attitude @ attitude)
        joints = np.concatenate([y[self._arm], further[0]]) if further else y[5:]
        omega, rates = self._solver.rates(attitude, joints, twist, speed, *further[1:])
        (a, b, c, w), (x, y_, z) = attitude.tolist(), (0.5 * omega).tolist()
        tangent = np.array([
            1.0 / self.unit,
            w * x + b * z - c * y_, w * y_ + c * x - a * z, w * z + a * y_ - b * x,  # (8c)
            -(a * x + b * y_ + c * z), *rates.tolist(),
        ])  # fmt: skip
        square = float(tangent @ tangent)
        if not math.isfinite(square):  # (4) is singular to the last digit: no time passes
            tangent = reference.copy()
            tangent[0] = 0.0
            return tangent
        return tangent * math.copysign(1.0 / math.sqrt(square), tangent @ reference)


class _Stepper:
    """Steps of DOP853 along the legs of a motion, between which the path's derivatives may jump.

    Legs may be as short as one step: each begins with the step that the one before proposed.
    """

    def __init__(self, flow: ArcFlow, tolerance: float, reference: Array) -> None:
        """Prepare; ``reference`` is a tangent (5 + n,) in whose direction to start."""
        self._flow, self._tolerance = flow, tolerance
        self._reference, self._direction = reference, float(reference[0])
        self._proposed: float | None = None
        self._steps_left = _MAX_STEPS

    def panels(
        self, row: Array, prescribed: Prescription, end: float
    ) -> Iterator[tuple[Array, bool]]:
        """Panels up to a time [s], each with whether the arm is singular at its end."""
        unit, sign = self._flow.unit, self._direction
        goal = end / unit
        y = np.concatenate([[row[0] / unit], row[1:]])

        def tangent(_: float, y: Array) -> Array:
            return self._flow(y, prescribed, self._reference)

        def pace_at(r: float, y: Dense) -> float:
            return sign * float(tangent(r, y(r))[0])

        # rates are differences of states by the length of the part, and as precise
        tolerance = max(self._tolerance * min(abs(goal - y[0]), 1.0), _FINEST)
        solver = scipy.integrate.DOP853(
            tangent, 0.0, y, np.inf, max_step=_LONGEST_STEP, rtol=tolerance, atol=tolerance,
            first_step=self._proposed,
        )  # fmt: skip
        self._reference = solver.f
        while self._steps_left:
            self._steps_left -= 1
            message = solver.step()
            if solver.status == "failed":
                raise IntegrationError(float(solver.y[0] * unit), str(message))
            dense, stop, pace = solver.dense_output(), solver.t, sign * solver.f[0]
            if pace < 0.0:
                stop = scipy.optimize.brentq(pace_at, solver.t_old, stop, (dense,))
            rows = _nodes(dense, solver.t_old, stop)
            if (np.diff(sign * rows[:, 0]) < 0.0).any():
                if (r := _reversal(pace_at, sign, dense, solver.t_old, stop)) is not None:
                    pace, stop = -1.0, scipy.optimize.brentq(pace_at, solver.t_old, r, (dense,))
                    rows = _nodes(dense, solver.t_old, stop)
                rows[:, 0] = sign * np.maximum.accumulate(sign * rows[:, 0])
            if arrived := bool(sign * rows[-1, 0] >= sign * goal):
                stop = scipy.optimize.brentq(
                    lambda r, y: y(r)[0] - goal, solver.t_old, stop, (dense,)
                )
                rows = _nodes(dense, solver.t_old, stop)
                self._proposed = solver.h_abs
            rows[:, 0] *= unit
            yield rows, not arrived and bool(pace <= self._flow.stalled)
            if arrived:
                return
            self._reference = solver.f
        reason = f"{_MAX_STEPS} steps were not enough"
        advice = "a shorter duration or less momentum: the system may rotate hundreds of times"
        raise IntegrationError(float(solver.y[0] * unit), reason, advice)


def _reversal(
    pace_at: Callable[[float, Dense], float], sign: float, dense: Dense, start: float, stop: float
) -> float | None:
    """Where time runs back inside a step at whose ends it does not; None where it does not.

    The interpolated time of a rough step may fall although the time of the curve does not.
    """
    nodes = start + (stop - start) * (NODES + 1.0) / 2.0
    for k in np.flatnonzero(sign * np.diff(dense(nodes)[0]) < 0.0):
        for r in (nodes[k], (nodes[k] + nodes[k + 1]) / 2.0, nodes[k + 1]):
            if pace_at(float(r), dense) < 0.0:
                return float(r)
    return None


def _nodes(dense: Dense, start: float, stop: float) -> Array:
    values = dense(start + (stop - start) * (NODES + 1.0) / 2.0).T
    values[:, 1:5] /= np.linalg.norm(values[:, 1:5], axis=1, keepdims=True)
    return values
