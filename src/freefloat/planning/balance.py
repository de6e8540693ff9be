"""Balance: the joint curve of an arm that keeps the spacecraft's attitude while another one works.

At an instant, the spacecraft's angular velocity is w0 + G z, z being the joint rates of the
balancing arm: w0 and G follow from equation (4), with which the arm on the path keeps following it.
In steps of fixed length, a quadratic program chooses the z within ranges and rates that brings the
velocity nearest to one that also takes back the turn so far. The joints between the steps are a
joint curve, and the motion along it is integrated and checked like any other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from freefloat.attitude_grids import low_discrepancy
from freefloat.concurrency import Progress, step_of
from freefloat.errors import InputError, finite_vector
from freefloat.limits.check import LimitChecker
from freefloat.limits.limits import Limits
from freefloat.limits.pairs import CollisionPairs
from freefloat.limits.result import violated
from freefloat.motion.arm_curves import ArmCurve, ArmCurves
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.planning.balance_settings import AXES, BalanceSettings
from freefloat.planning.objectives.objectives import objective_of
from freefloat.planning.plan import Plan
from freefloat.planning.planner import plan
from freefloat.planning.settings import FEWEST_SAMPLES, Search
from freefloat.so3 import Array

_STEPS = 64
_CHANGE = 0.05
"""Fraction of the duration in which rates change by their limit, and the distance to the end of a
range falls to 1 / e: so the rates of the joint curve stay within their limits."""
_EXCURSIONS = np.inf, 1.5, 1.0, 0.7, 0.45, 0.3, 0.15
"""Largest excursions of the joints from their start, tried until nothing is too near [rad, m]."""
_ROOM, _DRAWN = 0.02, 50
"""Distance beyond the clearance that starts have [m], and how many are drawn for each."""
_LOOKS = 4
"""Steps between two looks at clearances."""
_CHECKED = 6
"""Candidates that are integrated and checked before giving up."""
_TAKEN_BACK = 20.0
"""Rate at which the turn so far is taken back, per path: within a twentieth of it."""
_SMALL_RATES, _STEADY_RATES = 1e-4, 3e-3
"""Weights of the rates and of their changes, relative to the largest singular value of G."""
_SPARE = 0.05
"""Part of rates and ranges left to what the spline adds between steps."""
_AT_LIMIT = 0.999
_NEARBY = np.radians(0.1)
"""Where the plan is sought if the motion found breaks a limit, to say which [rad]."""
_FIRST_PLAN, _BALANCED = 0.4, 0.5
"""Parts of the time that the first plan takes, and with the balance."""


@dataclass(frozen=True, eq=False)
class Balance:
    """The joint curve of a balancing arm, and what it achieves.

    Attributes:
        settings: What was asked for.
        curve: The joint curve.
        turn: Largest turn of the spacecraft along the motion [rad], of two balanced axes the tilt
            of the third.
        held_turn: The same with the arm held where its joint curve began.
        at_rate: Fraction of the time at which a joint of the arm is at its rate limit.
        at_range: The same at the end of its range.
        tried: Turns over ``held_turn`` of all starts, as far as the steps tell; infinite where the
            arm on the path cannot follow it.
        kept: Whether the motion keeps the margin and the limits.
    """

    settings: BalanceSettings
    curve: ArmCurve = field(repr=False)
    turn: float
    held_turn: float
    at_rate: float
    at_range: float
    tried: tuple[float, ...]
    kept: bool

    @property
    def ratio(self) -> float:
        """Turn over that with the arm held; 1 where the spacecraft does not turn anyway."""
        return self.turn / self.held_turn if self.held_turn > 0.0 else 1.0

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return {
            "arm": self.settings.arm, "axes": self.settings.axes,
            "turn_deg": float(np.degrees(self.turn)),
            "held_turn_deg": float(np.degrees(self.held_turn)), "ratio": self.ratio,
            "time_at_rate_limits": self.at_rate, "time_at_range_limits": self.at_range,
            "tried": [ratio if np.isfinite(ratio) else None for ratio in self.tried],
            "kept": self.kept, "waypoints": self.curve.waypoints.tolist(),
            "times": self.curve.times.tolist(),
        }  # fmt: skip


def plan_balanced(
    problem: Problem,
    settings: BalanceSettings,
    search: Search | None = None,
    limits: Limits | None = None,
    *,
    threads: int | None = None,
    progress: Progress | None = None,
) -> tuple[Plan, Balance | None]:
    """Plan a path with the balancing arm at rest, let it balance, and plan again from there.

    The second plan keeps the attitude of the first one, or the nearest one with which the motion
    along the joint curve keeps margin and limits.

    Args:
        problem: As for :func:`balance`.
        settings: Which arm balances, and how.
        search: As for :func:`~freefloat.planning.planner.plan`.
        limits: As for :func:`balance`.
        threads: Number of cores to use; all available ones when left out.
        progress: Called with the fraction done, in [0, 1].

    Returns:
        The plan along the joint curve; where the first plan is not feasible, that and None.
    """
    search = search or Search()
    first = plan(
        problem, search, limits, threads=threads, progress=step_of(progress, 0.0, _FIRST_PLAN)
    )
    if not first.feasible or first.chosen is None:
        return first, None
    start = first.chosen.motion.initial.attitude
    balanced = balance(
        problem, start, first.chosen.branch.joints, settings, limits,
        step_of(progress, _FIRST_PLAN, _BALANCED),
    )  # fmt: skip
    arms = ArmCurves({**problem.arms.curves, settings.arm: balanced.curve})
    again = replace(
        search, objective=objective_of("nearest"), from_attitude=start, spare=0.0,
        joints=first.chosen.branch.joints, within=search.within if balanced.kept else _NEARBY,
    )  # fmt: skip
    if not balanced.kept:
        again = replace(again, samples=FEWEST_SAMPLES)
    found = plan(
        replace(problem, arms=arms),
        again,
        limits,
        threads=threads,
        progress=step_of(progress, _BALANCED, 1.0),
    )
    if found.chosen is None:
        return found, balanced
    turn = _turn(found.chosen.motion, settings.axes)
    return found, replace(balanced, turn=turn, kept=found.feasible)


def balance(
    problem: Problem,
    attitude: npt.ArrayLike,
    joints: npt.ArrayLike,
    settings: BalanceSettings,
    limits: Limits | None = None,
    progress: Progress | None = None,
) -> Balance:
    """Find the joint curve with which an arm keeps the spacecraft's attitude.

    Of the starts, the one with the least turn is chosen whose motion keeps margin and limits; where
    none does, the one with the least turn. With stored momentum the arm winds up to its limits.

    Args:
        problem: Robot and path, with a joint curve of the arm, of which the first state counts.
        attitude: Attitude of the spacecraft at the start, quaternion x, y, z, w.
        joints: Joint values of the arm on the path, near which it begins.
        settings: Which arm balances, and how.
        limits: Limits of the motion; those of joint rates, else the URDF's, bound the arm's rates.
        progress: Called with the fraction done, in [0, 1].

    Raises:
        InputError: If there is no such arm, or its rates have no limits.
        UnreachableError: If the arm does not reach the start of the path.

    Example:
        >>> import yaml
        >>> document = yaml.safe_load(ff.load_scenario("planar_2dof/line").text)
        >>> other = {"urdf": "planar_2dof", "prefix": "left_", "mount": {"rpy": [0, 0, 3.1416]}}
        >>> law = {"joints": [[0.5, 1.0], [0.5, 1.0]]}
        >>> arms = {"left": {"end_effector": "left_end_effector", "law": law}}
        >>> robot = {"urdf": "planar_2dof", "end_effector": "end_effector", "attached": [other]}
        >>> document |= {"robot": robot | {"arms": arms}, "limits": {}}
        >>> document |= {"margin": {"measure": "gjm", "value": 0.0}}
        >>> document["path"]["line"] = {"from": [0.9, 0.2, 0.0], "to": [0.6, 0.7, 0.0]}
        >>> problem, attitude = ff.load_scenario(document).problem(), [0.0, 0.0, 0.0, 1.0]
        >>> joints = problem.branches(attitude)[0].joints
        >>> limits = ff.Limits(joint_rate=[1.0] * 4)
        >>> found = ff.balance(problem, attitude, joints, ff.BalanceSettings("left"), limits)
        >>> found.kept, found.ratio < 0.01
        (True, True)
    """
    limits, attitude = limits or Limits(), problem.attitude(attitude)
    steps = _Steps(problem, settings, limits)
    near = finite_vector("joints", joints, problem.model.arm_dof)
    held = _motion(steps.with_curve(steps.constant), attitude, near)
    held_turn = np.inf if held is None else _turn(held, settings.axes)
    checker = LimitChecker(steps.with_curve(steps.constant), limits)
    runs: list[_Run] = []
    for number, start in enumerate(steps.starts(attitude, near, checker.pairs)):
        for excursion in _EXCURSIONS:
            run = steps.run(attitude, near, start, excursion, checker.pairs)
            if run is None or run.clear:
                break
        if run is not None:
            runs.append(run)
        if progress is not None:
            progress((number + 1) / settings.starts)
    turns = [run.turn for run in runs] + [np.inf] * (settings.starts - len(runs))
    best: Balance | None = None
    runs.sort(key=lambda run: (not run.clear, run.turn))
    for run in runs[:_CHECKED]:
        balanced = steps.with_curve(run.curve)
        motion = _motion(balanced, attitude, near)
        if motion is None:
            continue
        margins = [abs(problem.margin.measure(q)) for q in motion.joints]
        kept = motion.completed and not violated(checker.results(motion))
        kept = kept and bool(problem.margin.keeps(np.array(min(margins))))
        found = Balance(
            settings, run.curve, _turn(motion, settings.axes), held_turn, run.at_rate,
            run.at_range, tuple(turn / held_turn for turn in turns), kept,
        )  # fmt: skip
        if kept:
            return found
        best = best or found
    if best is None:
        raise InputError("balance.arm", "no motion along the path was found", "another attitude")
    return best


def _motion(problem: Problem, attitude: Array, near: Array) -> Motion | None:
    """The motion of the arm branch closest to joint values; None without one."""
    branches = problem.branches(attitude)
    if not branches:
        return None
    distances = [problem.model.joint_distance(branch.joints, near) for branch in branches]
    motion = integrate_motion(problem, attitude, branches[int(np.argmin(distances))].joints)
    return motion if motion.completed else None


def _turn(motion: Motion, axes: str) -> float:
    """Largest turn from the first attitude [rad], or tilt of the axis that is not balanced."""
    start = Rotation.from_quat(motion.attitudes[0])
    return max(float(np.linalg.norm(_error(start, Rotation.from_quat(a), axes)))
               for a in motion.attitudes)  # fmt: skip


def _error(start: Rotation, now: Rotation, axes: str) -> Array:
    """The rotation that leads back, spacecraft axes [rad], shape (3,)."""
    if axes == "xyz":
        return np.asarray((now.inv() * start).as_rotvec())
    free = np.eye(3)[next(k for k in range(3) if k not in AXES[axes])]
    wanted = (now.inv() * start).apply(free)
    across = np.cross(free, wanted)
    sine = float(np.linalg.norm(across))
    return across * (np.arctan2(sine, free @ wanted) / sine) if sine > 0.0 else across


@dataclass(frozen=True, eq=False)
class _Run:
    """Steps from one start."""

    curve: ArmCurve
    turn: float
    at_rate: float
    at_range: float
    clear: bool


class _Steps:
    """Steps of fixed length along the path, in which the arm balances."""

    def __init__(self, problem: Problem, settings: BalanceSettings, limits: Limits) -> None:
        model, name = problem.model, settings.arm
        if name not in model.arms:
            accepted = ", ".join(model.arms) or "a robot with an arm that moves beside the other"
            raise InputError("balance.arm", f"{name!r} was given", accepted)
        first = [model.joint_names.index(joint) for joint in model.joints_of_arm(name)]
        self._own = np.array(first) - model.arm_dof
        rates = np.array([model.bodies[1 + k].rated_speed for k in first])
        if limits.joint_rate is not None:
            rates = limits.joint_rate[first]
        if not np.isfinite(rates).all():
            accepted = "limits.joint_rate for all joints of the arm that balances"
            raise InputError("limits.joint_rate", f"arm {name} has none", accepted)
        low, high = (ends[first] for ends in model.joint_ranges)
        spare = np.where(np.isfinite(high - low), _SPARE * np.minimum(high - low, 1.0), 0.0)
        self._rates, self._low, self._high = (1.0 - _SPARE) * rates, low + spare, high - spare
        self._problem, self._settings, self._clearance = problem, settings, limits.clearance or 0.0
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
        return float(pairs.distances(joints, every, attitude, poses).min()) - self._clearance

    def run(
        self, attitude: Array, near: Array, start: Array, excursion: float,
        pairs: CollisionPairs | None,
    ) -> _Run | None:  # fmt: skip
        """Steps from a start, no farther from it than an excursion of the joints [rad or m].

        None where the arm on the path cannot follow it.
        """
        problem, n = self._problem, self._problem.model.arm_dof
        curve = ArmCurve.evenly(np.array([start, start]), problem.path.duration)
        branches = self.with_curve(curve).branches(attitude)
        if not branches:
            return None
        arm = min((branch.joints for branch in branches),
                  key=lambda q: problem.model.joint_distance(q, near))  # fmt: skip
        first = now = Rotation.from_quat(attitude)
        joints = np.concatenate([arm, problem.arms.at(0.0)])
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
            turns.append(float(np.linalg.norm(_error(first, now, self._settings.axes))))
            limited.append(bounds)
            if pairs is not None and clear and len(limited) % _LOOKS == 0:
                clear = self._room(t + step, now.as_quat(), joints, pairs) >= 0.0
        at_rate, at_range = np.mean(limited, axis=0)
        curve = ArmCurve(np.array(path), self._times)
        return _Run(curve, max(turns), float(at_rate), float(at_range), clear)

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
        wanted = back * _error(first, attitude, self._settings.axes)[rows] - w0
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
