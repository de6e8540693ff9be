"""Balance: the joint curve of an arm that keeps the spacecraft's attitude while another one works.

Steps of fixed length give the joints of the balancing arm; between them they are a joint curve, and
the motion along it is integrated and checked like any other.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from freefloat.concurrency import Progress, step_of
from freefloat.errors import InputError, finite_vector, require_type
from freefloat.limits.check import LimitChecker
from freefloat.limits.limits import Limits, limits_for
from freefloat.motion.arm_curves import ArmCurve, ArmCurves
from freefloat.motion.extrema import at_nodes, closest_approach, maximum
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.planning.balance_settings import BalanceSettings
from freefloat.planning.balance_steps import NEAR, BalanceRun, BalanceSteps, turn_back
from freefloat.planning.objectives.objectives import objective_of
from freefloat.planning.plan import Plan
from freefloat.planning.planner import plan
from freefloat.planning.reasons import verdict_on
from freefloat.planning.settings import FEWEST_SAMPLES, Search
from freefloat.so3 import Array

_EXCURSIONS = np.inf, 1.5, 1.0, 0.7, 0.45, 0.3, 0.15
"""Largest excursions of the joints from their start, tried until nothing is too near [rad, m]."""
_CHECKED = 6
"""Candidates that are integrated and checked before giving up."""
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
        joints: Joint values of the arm on the path at the start of the motion along it, (n,).
        turn: Largest turn of the spacecraft along the motion [rad], of two balanced axes the tilt
            of the third.
        held_turn: The same with the arm held where its joint curve began; None where the arm on
            the path cannot follow it then.
        at_rate: Fraction of the time at which a joint of the arm is as fast as balancing permits,
            90 % of its limit.
        at_range: The same slowed before the end of its range.
        tried: Turns over ``held_turn`` of all starts, as far as the steps tell; None where that is,
            or where the arm on the path does not begin near the joints asked for or cannot follow.
        kept: Whether the motion keeps the margin and the limits.
    """

    settings: BalanceSettings
    curve: ArmCurve = field(repr=False)
    joints: Array = field(repr=False)
    turn: float
    held_turn: float | None
    at_rate: float
    at_range: float
    tried: tuple[float | None, ...]
    kept: bool

    @property
    def ratio(self) -> float | None:
        """Turn over ``held_turn``, None where that is; 1 where both are zero."""
        return _ratio(self.turn, self.held_turn)

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return {
            "arm": self.settings.arm, "axes": self.settings.axes,
            "turn_deg": float(np.degrees(self.turn)),
            "held_turn_deg": None if self.held_turn is None else float(np.degrees(self.held_turn)),
            "ratio": self.ratio, "joints": self.joints.tolist(),
            "time_at_rate_limits": self.at_rate, "time_at_range_limits": self.at_range,
            "tried": list(self.tried), "kept": self.kept,
            "waypoints": self.curve.waypoints.tolist(), "times": self.curve.times.tolist(),
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
    limits = limits_for(problem, limits) or Limits()
    BalanceSteps(problem, settings, limits)  # refuses what it cannot balance at once
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
    turn, joints = _turn(found.chosen.motion, settings.axes), found.chosen.branch.joints
    if found.feasible:
        where = f"as near as the limits permit to that of the plan with {settings.arm} at rest"
        stated = replace(search, joints=again.joints)  # attitudes are compared with the present one
        found = replace(found, search=stated, reason=f"{where}: {first.reason}")
    return found, replace(balanced, joints=joints, turn=turn, kept=found.feasible)


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
    none does, the arm stays where its joint curve begins. With stored momentum the arm winds up to
    its limits.

    Args:
        problem: Robot and path, with a joint curve of the arm, of which the first state counts.
        attitude: Attitude of the spacecraft at the start, quaternion x, y, z, w.
        joints: Joint values of the arm on the path: it begins within 0.6 rad or m of each.
        settings: Which arm balances, and how.
        limits: Limits of the motion; those of joint rates, else the URDF's, bound the arm's rates.
        progress: Called with the fraction done, in [0, 1].

    Raises:
        InputError: If there is no such arm, its rates have no limits, the limits do not suit the
            robot, or no motion that begins near the joints completes the path.

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
    require_type("settings", settings, BalanceSettings, "BalanceSettings(arm, axes)")
    limits, attitude = limits_for(problem, limits) or Limits(), problem.attitude(attitude)
    near = finite_vector("joints", joints, problem.model.arm_dof)
    problem = problem.replace(start_joints=near)
    steps = BalanceSteps(problem, settings, limits)
    held = _motion(steps.with_curve(steps.constant), attitude, near)
    held_turn = None if held is None else _turn(held, settings.axes)
    checker = LimitChecker(steps.with_curve(steps.constant), limits)
    runs: list[BalanceRun] = []
    for number, start in enumerate(steps.starts(attitude, near, checker.pairs)):
        for excursion in _EXCURSIONS:
            run = steps.run(attitude, near, start, excursion, checker.pairs)
            if run is None or run.clear:
                break
        if run is not None:
            runs.append(run)
        if progress is not None:
            progress((number + 1) / settings.starts)
    tried = [_ratio(run.turn, held_turn) for run in runs] + [None] * (settings.starts - len(runs))
    best: Balance | None = None
    runs.sort(key=lambda run: (not run.clear, run.turn))
    still = BalanceRun(steps.constant, 0.0, 0.0, 0.0, True)  # where no motion keeps the limits
    for run in [*runs[:_CHECKED], still]:
        balanced = steps.with_curve(run.curve)
        motion = _motion(balanced, attitude, near)
        if motion is None:
            continue
        approach = closest_approach(motion, problem.margin.measure)
        kept = verdict_on(motion, checker.results(motion), approach).feasible
        found = Balance(
            settings, run.curve, motion.initial.joints[: len(near)], _turn(motion, settings.axes),
            held_turn, run.at_rate, run.at_range, tuple(tried), kept,
        )  # fmt: skip
        if kept:
            return found
        best = best or found
    if best is None:
        text = f"no motion that begins within {NEAR} rad or m of {near.tolist()} was found"
        raise InputError("joints", text, "those of an arm branch, or another attitude")
    return best


def _ratio(turn: float, held_turn: float | None) -> float | None:
    """Turn over that with the arm held; 1 where neither turns the spacecraft."""
    if held_turn is None:
        return None
    return turn / held_turn if held_turn > 0.0 else 1.0


def _motion(problem: Problem, attitude: Array, near: Array) -> Motion | None:
    """The motion of the arm branch near joint values; None without one."""
    branch = problem.nearest(near, problem.branches(attitude), NEAR)
    if branch is None:
        return None
    motion = integrate_motion(problem, attitude, branch.joints)
    return motion if motion.completed else None


def _turn(motion: Motion, axes: str) -> float:
    """Largest turn from the first attitude [rad], or tilt of the axis that is not balanced."""
    start = Rotation.from_quat(motion.attitudes[0])

    def turn(panel: int, x: float) -> Array:
        back = turn_back(start, Rotation.from_quat(motion.at(panel, x)[1]), axes)
        return np.array([np.linalg.norm(back)])

    return maximum(at_nodes(motion, turn), turn).value
