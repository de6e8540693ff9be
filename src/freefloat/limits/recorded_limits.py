"""Limits that ensembles do not know, along recorded motions; torques all at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.polynomial import chebyshev

from freefloat.dynamics.denavit_hartenberg import frames_at_zero, in_frame, joints_at_zero
from freefloat.ensemble.ensemble import RecordedMotions, in_panels
from freefloat.ensemble.known_limits import KNOWN, LimitValues
from freefloat.ensemble.robots import Robots
from freefloat.ensemble.systems import ScaledMotions
from freefloat.limits.kinds import KINDS
from freefloat.limits.kinds.clearance import ClearanceLimit
from freefloat.limits.kinds.end_effector import CorridorLimit
from freefloat.limits.kinds.joints import JointTorqueLimit
from freefloat.limits.limit import Limit
from freefloat.limits.limits import Limits
from freefloat.motion.law import PathLaw
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.panels import DEGREE, TO_COEFFICIENTS
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, BoolArray

_ELSEWHERE = (*KNOWN, JointTorqueLimit.name)
ALONG = tuple(sorted(
    (kind for kind in KINDS if kind.name not in _ELSEWHERE), key=lambda kind: kind is ClearanceLimit
))  # fmt: skip
"""Limits that are checked one motion after the other, the slowest last."""
_PANELS = 16, 64
"""Least numbers of panels of motions; the second where the first does not resolve torques."""
_RESOLVED = 1e-5
"""Largest error of a ratio of torques, relative to the ratio."""
_UNDECIDED = 1e-4
"""Distance from a bound within which other limits are not decided, relative to the bound."""
_POINTS = np.linspace(-1.0, 1.0, 65)
_TO_POINTS = chebyshev.chebvander(_POINTS, DEGREE) @ TO_COEFFICIENTS
"""Maps values at the nodes of a panel to values at evenly spaced parameters."""
_LAST = 3
"""Number of last Chebyshev coefficients from which the interpolation error is estimated."""


@dataclass(frozen=True, eq=False)
class RecordedLimits:
    """Limits of motions of one arm: torques of all motions at once, others one after the other."""

    problem: Problem  # the problem that disturbed motions have in common
    joint_torque: Array | None = None  # largest magnitudes [N m or N], (n,); None without limit
    along: tuple[Limit[Any], ...] = ()  # limits that are checked one motion after the other

    @classmethod
    def of(cls, problem: Problem, limits: Limits, *, moved: bool) -> RecordedLimits:
        """The limits of a problem; contact is none unless a clearance is stated.

        Args:
            problem: The problem.
            limits: Limits of the problem.
            moved: Whether durations or robots vary, so that the bodies of a scene are elsewhere.

        Raises:
            ModelError: If a clearance is required and the shapes of the robot cannot be used.
        """
        apart: set[type[Limit[Any]]] = set()
        if moved and problem.scene.bodies:
            apart = {CorridorLimit, ClearanceLimit}
        if limits.clearance is None:
            apart.add(ClearanceLimit)
        along = (kind.of(problem, limits) for kind in ALONG if kind not in apart)
        return cls(problem, limits.joint_torque, tuple(limit for limit in along if limit))

    @property
    def without(self) -> RecordedLimits:
        """No limits of the same problem."""
        return RecordedLimits(self.problem)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the limits in results."""
        torque = () if self.joint_torque is None else (JointTorqueLimit.name,)
        return *torque, *(limit.name for limit in self.along)

    @cached_property
    def places(self) -> tuple[tuple[str, ...], ...]:
        """Joints, or other names, of the quantities of each limit."""
        joints = self.problem.model.joint_names
        torque = () if self.joint_torque is None else (joints,)
        return *torque, *(limit.places(self.problem) for limit in self.along)

    def values(
        self, disturbed: ScaledMotions, attitudes: Array, joints: Array, threads: int
    ) -> LimitValues:
        """The limits along motions from attitudes (K, 4) and joints (K, n).

        Limits that cannot be decided are not certain. The scales of torques are the last columns of
        ``disturbed.scales``; the other limits have none.
        """
        values = LimitValues.empty(len(disturbed), len(self.names))
        missing = np.arange(len(disturbed))
        for panels in _PANELS[: 1 if self.joint_torque is None else 2]:
            starts = attitudes[missing], joints[missing]
            recorded = RecordedMotions.of(disturbed[missing], *starts, panels, threads)
            results, resolved = self._along(recorded, threads)
            for array, part in zip(values, results, strict=True):
                array[missing] = part
            missing = missing[~resolved & recorded.completed]
            if not len(missing):
                break
        return values

    def _along(self, recorded: RecordedMotions, threads: int) -> tuple[LimitValues, BoolArray]:
        """The limits along recorded motions, and whether torques are resolved, shape (K,)."""
        count, rows = len(recorded.joints), np.arange(len(recorded.joints))
        values = LimitValues.empty(count, len(self.names))
        known, resolved = recorded.completed.copy(), recorded.completed.copy()
        if self.joint_torque is not None:
            torques = largest_torques(recorded, threads)
            scales = recorded.disturbed.scales[:, -len(self.joint_torque) :] / self.joint_torque
            ratios, errors = torques.values * scales, torques.errors * scales
            place = ratios.argmax(axis=1)
            largest, error = ratios[rows, place], errors.max(axis=1)
            values.ratios[:, 0], values.times[:, 0] = largest, torques.times[rows, place]
            values.places[:, 0] = place
            resolved &= error <= _RESOLVED * largest
            values.certain[:, 0] = resolved & (np.abs(largest - 1.0) > 2.0 * _RESOLVED)
            known &= values.certain[:, 0]
        for k in np.flatnonzero(known).tolist() if self.along else ():
            self._note(recorded, k, values)
        return values, resolved

    def _note(self, recorded: RecordedMotions, k: int, values: LimitValues) -> None:
        """Write the limits along motion k."""
        problem, stretch = self.problem, recorded.disturbed.stretches[k]
        if problem.scene.bodies or any(limit.exponent for limit in self.along):
            problem = recorded.disturbed.problem_of(k)
        states = recorded.times, recorded.attitudes[k], recorded.joints[k]
        motion = Motion(PathLaw(problem), Ending.COMPLETED, *states)
        for column, limit in enumerate(self.along, len(self.names) - len(self.along)):
            result, scale = limit.worst(motion), stretch**-limit.exponent
            values.ratios[k, column] = result.ratio * scale
            values.times[k, column] = result.time * stretch
            values.places[k, column] = self.places[column].index(result.where)
            worst = (result.worst if result.at_least else abs(result.worst)) * scale
            error = max(limit.accuracy, _UNDECIDED * abs(result.allowed))
            values.certain[k, column] = abs(worst - result.allowed) > error


class LargestTorques(NamedTuple):
    """The largest magnitude of the torque or force of each joint along K motions."""

    values: Array  # the magnitudes [N m or N], (K, n)
    times: Array  # times of the magnitudes [s], (K, n)
    errors: Array  # estimated errors of the magnitudes, (K, n)


def largest_torques(recorded: RecordedMotions, threads: int) -> LargestTorques:
    """The largest torques along recorded motions of robots with one moving arm.

    Torques depend on the states and their derivatives by time, found from the panels' polynomials.
    The base accelerates as it does without an external force.
    """
    torques = _torques(recorded, threads)
    shown = np.abs(_TO_POINTS @ torques)  # (K, P, 65, n)
    count, _, points, n = shown.shape
    rows = np.arange(count)[:, None]
    best = shown.reshape(count, -1, n).argmax(axis=1)
    panel, point = np.divmod(best, points)
    middle, joint = np.clip(point, 1, points - 2), np.arange(n)
    before, at, after = (shown[rows, panel, middle + k, joint] for k in (-1, 0, 1))
    bend = before - 2.0 * at + after
    with np.errstate(divide="ignore", invalid="ignore"):
        place = np.where(bend < 0.0, 0.5 * (before - after) / bend, 0.0)
    inside = np.abs(place) <= 1.0
    top = np.where(inside, at - 0.25 * (before - after) * place, 0.0)
    values = np.maximum(shown[rows, panel, point, joint], top)
    x = np.where(inside, middle + place, point) / (points - 1)
    edges = recorded.panel_times[rows, panel]
    times = edges[..., 0] + x * (edges[..., -1] - edges[..., 0])
    last = np.abs((TO_COEFFICIENTS @ torques)[:, :, -_LAST:]).sum(axis=2)
    return LargestTorques(values, times, last.max(axis=1))


def _torques(recorded: RecordedMotions, threads: int) -> Array:
    """Joint torques at the nodes of panels, shape (K, P, 9, n)."""
    joints, attitudes = in_panels(recorded.joints), in_panels(recorded.attitudes)
    rates, slopes = recorded.rates(joints), recorded.rates(attitudes)
    x, w, dx, dw = attitudes[..., :3], attitudes[..., 3:], slopes[..., :3], slopes[..., 3:]
    omega = 2.0 * (w * dx - dw * x - np.cross(x, dx))
    still = np.zeros_like(omega)  # torques do not depend on the velocity of the base
    velocities = still, omega, rates
    accelerations = still, recorded.rates(omega), recorded.rates(rates)
    each = (still, attitudes, joints), velocities, accelerations
    states = [np.concatenate(parts, axis=-1) for parts in each]
    disturbed = recorded.disturbed
    model, robots = disturbed.problem.model, disturbed.systems.robots
    threads = threads if robots is None else 1  # waiting threads would take time
    free = slice(2 if model.on_table else 3)  # the base does not rise from a table
    pool = pin.ModelPool(model.pin_model, threads)
    torques = np.empty(joints.shape)
    every = [slice(None)] if robots is None else [slice(k, k + 1) for k in range(len(joints))]
    masses = np.full(len(joints), sum(body.mass for body in model.bodies))
    inertias: Iterator[list[pin.Inertia]] = iter(())
    if robots is not None:
        inertias, masses = _inertias(robots), robots.total_masses
    for some in every:
        for number, inertia in enumerate(next(inertias, []), 1):
            pool.getModel(0).inertias[number] = inertia
        q, v, a = (np.asfortranarray(rows[some].reshape(-1, rows.shape[-1]).T) for rows in states)
        a[free] = -pin.rneaInParallel(threads, pool, q, v, a)[free] / masses[some][0]
        forces = pin.rneaInParallel(threads, pool, q, v, a)
        torques[some] = forces[6:].T.reshape(torques[some].shape)
    return torques * disturbed.factors[:, None, None, None]


def _inertias(robots: Robots) -> Iterator[list[pin.Inertia]]:
    """Yield the inertias of the bodies of each robot in Pinocchio's frames."""
    frames, (_, points, rotations) = frames_at_zero(robots.frames), joints_at_zero(robots.nominal)
    origins = np.vstack([np.zeros(3), points])[: len(frames)]
    turns = np.stack([np.eye(3), *rotations])[: len(frames)].swapaxes(1, 2)
    positions = (turns @ (frames[:, 3] - origins)[..., None])[..., 0]
    rows = in_frame(robots.bodies, turns @ frames[:, :3].swapaxes(1, 2), positions)
    masses = rows[..., 0]
    centres = rows[..., 1:4] / np.where(masses > 0.0, masses, 1.0)[..., None]
    about = in_frame(rows, np.eye(3), -centres)[..., [4, 9, 8, 9, 5, 7, 8, 7, 6]]
    about = about.reshape(*masses.shape, 3, 3)
    for robot in zip(masses.tolist(), centres, about, strict=True):
        yield [pin.Inertia(*body) for body in zip(*robot, strict=True)]
