"""The flow of (8), integrated precisely along its own arc length.

Near a dynamic singularity the rates grow without bound as functions of time, yet the curve that
the state draws through (time, attitude, joints) stays smooth: there it turns back in time. Followed
along its arc length it is an ordinary curve, and the singularity is the point of its largest time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.integrate import DOP853
from scipy.optimize import brentq

from freefloat.dynamics.momentum import generalized_jacobian
from freefloat.errors import InputError, IntegrationError
from freefloat.motion.arc_length import ArcFlow, arc_flow
from freefloat.motion.closest_approach import first_place_below
from freefloat.motion.motion import NODES, Ending, Motion
from freefloat.motion.problem import Problem, require_problem
from freefloat.so3 import Array, finite_number, rotation_vector_between

_LONGEST_STEP = 1.0
_MAX_STEPS = 20_000
_AIM, _SLOWEST = 1.1, 1e-3
"""By how much a step that is to reach a time is made longer; pace below which none is aimed."""
_FINEST = 1e-13
_ROUGHEST = 1e-2
"""Tolerances lie between these: finer ones are lost in rounding, rougher ones say nothing."""
_RANK_LOST = 1e-9
"""A start is singular when S*'s smallest singular value is below this share of its largest."""
_MEETS = 1e-6
"""Joints meet the start of the path when the end-effector is off by less than this [m, rad]."""


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
    """Follow the path from an attitude and an arm configuration.

    The motion ends where the path does, or exactly where the arm becomes dynamically singular:
    where det S* changes sign or the rates by time grow beyond all bounds.

    Args:
        problem: Robot, path and momentum.
        attitude: Of the spacecraft at ``start``, quaternion x, y, z, w.
        joints: Joint values at ``start``, shape (n,); the end-effector must be on the path.
        start: Where on the time law to begin [s].
        end: Where to stop [s]; the duration when left out. An ``end`` before ``start`` retraces the
            motion that leads to ``start``: the paper's reverse motion with -h (Appendix A).
        stop_at_margin: End where the problem's margin is used up.
        tolerance: Relative and absolute, of the integrator, per step; from 1e-13 to 1e-2.

    Returns:
        The motion, whatever its ending.

    Raises:
        InputError: If it is no problem, the joints do not meet the path at ``start``, or a time or
            the tolerance is none.
        IntegrationError: If the integrator gives up for a reason other than a singularity.
    """
    require_problem(problem)
    tolerance = _checked_tolerance(tolerance)
    attitude = problem.attitude("attitude", attitude)
    joints = problem.model.joint_vector(joints)
    duration = problem.path.duration
    end = duration if end is None else end
    for key, time in (("start", start), ("end", end)):
        if not 0.0 <= time <= duration:
            raise InputError(key, f"{time} was given", f"a time from 0 to {duration:g} s")
    _refuse_off_path(problem, attitude, joints, start)
    flow = arc_flow(problem, 1.0 if end >= start else -1.0)
    first = np.concatenate([[start], attitude, joints])
    rows, ending = _follow(problem, flow, first, end, tolerance)
    motion = Motion(problem, ending, rows[:, 0], rows[:, 1:5], rows[:, 5:])
    if flow.determinant is not None:
        motion = _cut(motion, first_place_below(motion, flow.determinant, 0.0), Ending.SINGULAR)
    margin = problem.margin
    if stop_at_margin and margin.threshold > 0.0:
        place = first_place_below(motion, margin.measure, margin.threshold)
        motion = _cut(motion, place, Ending.MARGIN)
    return motion


def _checked_tolerance(given: float) -> float:
    accepted = f"a number from {_FINEST:g} to {_ROUGHEST:g}"
    tolerance = finite_number("tolerance", given, accepted)
    if not _FINEST <= tolerance <= _ROUGHEST:
        raise InputError("tolerance", f"{given} was given", accepted)
    return tolerance


def _cut(motion: Motion, place: float | None, ending: Ending) -> Motion:
    return motion if place is None else motion.cut(place, ending)


def _refuse_off_path(problem: Problem, attitude: Array, joints: Array, start: float) -> None:
    wanted = problem.path.pose(start)
    found = problem.model.end_effector_pose(attitude, joints)
    turn = rotation_vector_between(found.rotation, wanted.rotation)
    off = found.position - wanted.position
    if np.abs(np.concatenate([off, turn])[problem.task.rows]).max() > _MEETS:
        raise InputError(
            "joints",
            f"the end-effector would stand {np.linalg.norm(off):.3g} m and "
            f"{np.linalg.norm(turn):.3g} rad off the path at t = {start:g} s",
            "joints that meet the path; Problem.branches(attitude) lists them",
        )


def _follow(
    problem: Problem, flow: ArcFlow, row: Array, end: float, tolerance: float
) -> tuple[Array, Ending]:
    """Nodes (time, attitude, joints) of the motion from a first one to a time or a singularity."""
    panels, stepping = [row[None]], _Stepping(flow, tolerance, bool(len(problem.path.path.breaks)))
    if _is_singular(problem, row[5:]):
        return panels[0], Ending.SINGULAR
    for start, leg_end in pairwise(_legs(problem, float(row[0]), end)):
        flow.piece, flow.tangent = problem.path.between(start, leg_end)
        for panel, turned in stepping.panels(panels[-1][-1], leg_end):
            panels.append(panel[1:])
            if turned:
                return np.vstack(panels), Ending.SINGULAR
        panels[-1][-1, 0] = leg_end
    return np.vstack(panels), Ending.COMPLETED


def _is_singular(problem: Problem, joints: Array) -> bool:
    S = generalized_jacobian(problem.model, joints, problem.task)
    values = np.linalg.svd(S, compute_uv=False)
    return bool(values[-1] < _RANK_LOST * values[0])


def _legs(problem: Problem, start: float, end: float) -> list[float]:
    """Times from start to end between which nothing jumps."""
    if start == end:
        return [start]
    breaks = problem.path.breaks
    low, high = sorted((start, end))
    between = breaks[(breaks > low) & (breaks < high)].tolist()
    return [start, *(between if end > start else reversed(between)), end]


class _Stepping:
    """Steps of DOP853 along legs.

    Attributes:
        aimed: Legs end where the path's derivatives jump, maybe after one step each: steps are made
            no longer than their legs, and a leg begins with the step that the one before proposed.
    """

    def __init__(self, flow: ArcFlow, tolerance: float, aimed: bool) -> None:
        self._flow, self._tolerance, self.aimed = flow, tolerance, aimed
        self._proposed: float | None = None
        self._left = _MAX_STEPS

    def panels(self, row: Array, end: float) -> Iterator[tuple[Array, bool]]:
        """Panels up to a time, each with whether time turned back at its end."""
        flow = self._flow
        direction = np.sign(flow.reference[0])
        goal = end / flow.unit
        start = np.concatenate([[row[0] / flow.unit], row[1:]])
        e = self._tolerance_on(abs(goal - start[0]))
        solver = DOP853(
            flow, 0.0, start, np.inf, max_step=_LONGEST_STEP, rtol=e, atol=e,
            first_step=self._proposed,
        )  # fmt: skip
        flow.reference = solver.f
        while self._left:
            self._left -= 1
            self._aim(solver, goal)
            message = solver.step()
            if solver.status == "failed":
                raise IntegrationError(float(solver.y[0] * flow.unit), str(message))
            dense = solver.dense_output()
            stop, pace = solver.t, direction * solver.f[0]
            turned = bool(pace <= flow.stalled)
            if pace < 0.0:
                stop = brentq(partial(_pace, flow, dense), solver.t_old, stop, xtol=1e-14)
            if direction * (dense(stop)[0] - goal) >= 0.0:
                stop = brentq(partial(_lateness, dense, goal), solver.t_old, stop, xtol=1e-14)
                yield _nodes(flow, dense, solver.t_old, stop), False
                self._proposed = solver.h_abs if self.aimed else None
                return
            yield _nodes(flow, dense, solver.t_old, stop), turned
            if turned:
                return
            flow.reference = solver.f
        raise IntegrationError(
            float(solver.y[0] * flow.unit),
            f"{_MAX_STEPS} steps were not enough",
            "a shorter duration or less momentum: the system may tumble hundreds of times on the "
            "way",
        )

    def _tolerance_on(self, leg: float) -> float:
        """Per step of a leg: rates are differences of states by its length, and as precise."""
        if not self.aimed:
            return self._tolerance
        return max(self._tolerance * min(leg, 1.0), min(self._tolerance, _FINEST))

    def _aim(self, solver: DOP853, goal: float) -> None:
        """Make the next step no longer than it takes to reach a time, and a little."""
        if self.aimed:
            needed = _AIM * abs(goal - solver.y[0]) / max(abs(solver.f[0]), _SLOWEST)
            solver.h_abs = min(solver.h_abs, needed)


def _pace(flow: ArcFlow, dense: Callable[[float], Array], along: float) -> float:
    return float(flow(along, dense(along))[0])


def _lateness(dense: Callable[[float], Array], goal: float, along: float) -> float:
    return float(dense(along)[0] - goal)


def _nodes(flow: ArcFlow, dense: Callable[[Array], Array], start: float, stop: float) -> Array:
    values = dense(start + (stop - start) * (NODES + 1.0) / 2.0).T
    values[:, 0] *= flow.unit
    values[:, 1:5] /= np.linalg.norm(values[:, 1:5], axis=1, keepdims=True)
    return values
