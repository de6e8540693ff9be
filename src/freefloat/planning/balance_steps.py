"""Steps of fixed length in which an arm balances the spacecraft while another one follows a path.

At an instant, the spacecraft's angular velocity is w0 + G z, z being the joint rates of the
balancing arm: w0 and G follow from equation (4), with which the arm on the path keeps following it.
In each step a quadratic program chooses the z within ranges and rates that brings the velocity
nearest to one that also takes back the turn so far.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.attitude_grids import low_discrepancy
from freefloat.errors import InputError
from freefloat.limits.limits import Limits, require_applicable
from freefloat.limits.pairs import CollisionPairs
from freefloat.motion.arm_curves import ArmCurve, ArmCurves
from freefloat.motion.problem import Problem
from freefloat.planning.balance_settings import AXES, BalanceSettings
from freefloat.so3 import Array

_STEPS = 64
_CHANGE = 0.05
"""Fraction of the duration in which rates change by their limit, and the distance to the end of a
range falls to 1 / e: so the rates of the joint curve stay within their limits."""
_ROOM, _DRAWN = 0.02, 50
"""Distance beyond the clearance that starts have [m], and how many are drawn for each."""
_LOOKS = 4
"""Steps between two looks at clearances."""
_TAKEN_BACK = 20.0
"""Rate at which the turn so far is taken back, per path: within a twentieth of it."""
_SMALL_RATES, _STEADY_RATES = 1e-4, 3e-3
"""Weights of the rates and of their changes, relative to the largest singular value of G."""
_SPARE, _SPARE_RATES = 0.05, 0.1
"""Part of ranges, and of rates, left to what the spline adds between steps."""
_AT_LIMIT = 0.999
NEAR = 0.6
"""Largest distance of the arm on the path from the joints near which it begins [rad or m]."""


def turn_back(start: Rotation, now: Rotation, axes: str) -> Array:
    """The rotation that leads back, spacecraft axes [rad], shape (3,)."""
    if axes == "xyz":
        return np.asarray((now.inv() * start).as_rotvec())
    free = np.eye(3)[next(k for k in range(3) if k not in AXES[axes])]
    wanted = (now.inv() * start).apply(free)
    across = np.cross(free, wanted)
    sine = float(np.linalg.norm(across))
    return across * (np.arctan2(sine, free @ wanted) / sine) if sine > 0.0 else across


@dataclass(frozen=True, eq=False)
class BalanceRun:
    """Steps from one start."""

    curve: ArmCurve
    turn: float
    at_rate: float
    at_range: float
    clear: bool


class BalanceSteps:
    """Steps of fixed length along the path, in which the arm balances."""

    def __init__(self, problem: Problem, settings: BalanceSettings, limits: Limits) -> None:
        model, name = problem.model, settings.arm
        if name not in model.arms:
            accepted = ", ".join(model.arms) or "a robot with an arm that moves beside the other"
            raise InputError("balance.arm", f"{name!r} was given", accepted)
        require_applicable(model, limits)
        first = [model.joint_names.index(joint) for joint in model.joints_of_arm(name)]
        self._own = np.array(first) - model.arm_dof
        rates = np.array([model.bodies[1 + k].rated_speed for k in first])
        if limits.joint_rate is not None:
            rates = limits.joint_rate[first]
        if not np.isfinite(rates).all():
            accepted = "limits.joint_rate for all joints of the arm that balances"
            raise InputError("limits.joint_rate", f"arm {name} has none", accepted)
        low, high = (ends[first] for ends in model.joint_ranges)
        own = problem.arms.curves[name].waypoints[0]
        for joint, value, *ends in zip(model.joints_of_arm(name), own, low, high, strict=True):
            if not ends[0] <= value <= ends[1]:
                accepted = f"{ends[0]:g} to {ends[1]:g} rad or m"
                raise InputError("balance.start", f"{joint} is {value:g}", accepted)
        spare = np.where(np.isfinite(high - low), _SPARE * np.minimum(high - low, 1.0), 0.0)
        self._rates, self._low, self._high = (1.0 - _SPARE_RATES) * rates, low + spare, high - spare
        self._problem, self._settings = problem, settings
        self._solver = problem.resolved_rate_solver()
        self._times = np.linspace(0.0, problem.path.duration, _STEPS + 1)

    @property
    def constant(self) -> ArmCurve:
        """The arm at rest where its joint curve begins."""
        first = self._problem.arms.curves[self._settings.arm].waypoints[0]
        return ArmCurve.evenly(np.array([first, first]), self._problem.path.duration)

    def with_curve(self, curve: ArmCurve) -> Problem:
        """The problem with another joint curve of the arm."""
        curves = {**self._problem.arms.curves, self._settings.arm: curve}
        return replace(self._problem, arms=ArmCurves(curves))

    def starts(self, attitude: Array, near: Array, pairs: CollisionPairs | None) -> Iterator[Array]:
        """Configurations of the arm at the start, all but the first with room around the bodies."""
        yield self.constant.waypoints[0]
        low, high = np.maximum(self._low, -np.pi), np.minimum(self._high, np.pi)
        shift = np.random.default_rng(self._settings.seed).random(len(low))
        count, n = self._settings.starts - 1, self._problem.model.arm_dof
        left, joints = count, self._problem.all_joints(near, 0.0)
        for number, fraction in enumerate(low_discrepancy(_DRAWN * count, len(low))):
            start = low + (high - low) * ((fraction + shift) % 1.0)
            joints[n + self._own] = start
            last = _DRAWN * count - number <= left
            if last or pairs is None or self._room(0.0, attitude, joints, pairs) > _ROOM:
                left -= 1
                yield start
            if not left:
                return

    def _room(self, t: float, attitude: Array, joints: Array, pairs: CollisionPairs) -> float:
        """Smallest distance of bodies in a state beyond the clearance [m]."""
        every, poses = np.arange(len(pairs.pairs)), pairs.scene.poses(t, self._problem.path)
        return float(pairs.distances(joints, every, attitude, poses).min()) - pairs.clearance

    def run(
        self, attitude: Array, near: Array, start: Array, excursion: float,
        pairs: CollisionPairs | None,
    ) -> BalanceRun | None:  # fmt: skip
        """Steps from a start, no farther from it than an excursion of the joints [rad or m].

        None where the arm on the path cannot begin near joints, or cannot follow it.
        """
        problem, n = self._problem, self._problem.model.arm_dof
        curve = ArmCurve.evenly(np.array([start, start]), problem.path.duration)
        branch = problem.nearest(near, self.with_curve(curve).branches(attitude), NEAR)
        if branch is None:
            return None
        first = now = Rotation.from_quat(attitude)
        joints = problem.all_joints(branch.joints, 0.0)
        joints[n + self._own] = start
        rates, path, turns, limited = np.zeros(len(start)), [start], [0.0], []
        clear = pairs is None or self._room(0.0, attitude, joints, pairs) >= 0.0
        step = self._times[1]
        ends = np.maximum(self._low, start - excursion), np.minimum(self._high, start + excursion)
        for t in self._times[:-1].tolist():
            omega, joint_rates = self._rates_at(t, now, joints, rates)
            ahead = now * Rotation.from_rotvec(step / 2.0 * omega)
            middle = joints + step / 2.0 * joint_rates
            own = joints[n + self._own]
            low, high = ((end - own) / (_CHANGE * self._times[-1]) for end in ends)
            rates, bounds = self._chosen(t + step / 2.0, first, ahead, middle, (low, high), rates)
            omega, joint_rates = self._rates_at(t + step / 2.0, ahead, middle, rates)
            if not np.isfinite(joint_rates).all():
                return None
            now, joints = now * Rotation.from_rotvec(step * omega), joints + step * joint_rates
            path.append(joints[n + self._own].copy())
            turns.append(float(np.linalg.norm(turn_back(first, now, self._settings.axes))))
            limited.append(bounds)
            if pairs is not None and clear and len(limited) % _LOOKS == 0:
                clear = self._room(t + step, now.as_quat(), joints, pairs) >= 0.0
        at_rate, at_range = np.mean(limited, axis=0)
        curve = ArmCurve(np.array(path), self._times)
        return BalanceRun(curve, max(turns), float(at_rate), float(at_range), clear)

    def _rates_at(
        self, t: float, attitude: Rotation, joints: Array, rates: Array
    ) -> tuple[Array, Array]:
        """Angular velocity of the spacecraft and joint rates for rates of the arm."""
        twist, speed, further = self._problem.prescribed(t)
        arms = np.array(further)
        arms[self._own] = rates
        return self._solver.rates(attitude.as_quat(), joints, twist, speed, arms)

    def _chosen(
        self, t: float, first: Rotation, attitude: Rotation, joints: Array,
        ends: tuple[Array, Array], last: Array,
    ) -> tuple[Array, Sequence[bool]]:  # fmt: skip
        """Rates of the arm in a step, and whether they are at limits of rates and of ranges.

        Args:
            t: Time [s].
            first: Attitude at the start of the motion.
            attitude: The present one.
            joints: Joint values, shape (n,).
            ends: Smallest and largest rates that the ends of the ranges permit.
            last: Rates in the last step.
        """
        from scipy.optimize import lsq_linear  # imported late: it takes a third of a second

        rows = AXES[self._settings.axes]
        count = len(last)
        units = np.vstack([np.zeros(count), np.eye(count)])
        velocities = np.array([self._rates_at(t, attitude, joints, z)[0] for z in units])[:, rows]
        G, w0 = (velocities[1:] - velocities[0]).T, velocities[0]
        if not np.isfinite(G).all():
            return last, (False, False)
        back = _TAKEN_BACK * self._problem.path.timing.s(t, 1)
        wanted = back * turn_back(first, attitude, self._settings.axes)[rows] - w0
        size = float(np.linalg.norm(G, 2))
        small, steady = _SMALL_RATES * size * np.eye(count), _STEADY_RATES * size * np.eye(count)
        change = self._rates / (_CHANGE * _STEPS)
        low = np.clip(ends[0], -self._rates, 0.0)
        high = np.clip(ends[1], 0.0, self._rates)
        slow, fast = np.maximum(low, last - change), np.minimum(high, last + change)
        slow = np.minimum(slow, fast)
        wide = np.maximum(fast, slow + 1e-9 * self._rates)
        matrix = np.vstack([G, small, steady])
        right = np.concatenate([wanted, np.zeros(count), _STEADY_RATES * size * last])
        rates = np.clip(lsq_linear(matrix, right, (slow, wide), method="bvls").x, slow, fast)
        at_rate = bool((np.abs(rates) >= _AT_LIMIT * self._rates).any())
        stopped = (low > -self._rates) & (rates <= _AT_LIMIT * low)
        stopped |= (high < self._rates) & (rates >= _AT_LIMIT * high)
        return rates, (at_rate, bool(stopped.any()))
