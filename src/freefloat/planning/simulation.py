"""Simulation of one initial attitude: the motions of arm branches, one of them chosen."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy.typing as npt

from freefloat.dynamics.redundancy import Redundancy
from freefloat.errors import InputError
from freefloat.ik.branches import ArmBranch
from freefloat.limits.check import LimitChecker
from freefloat.limits.contact import Contact, deepest_contact
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult, violated
from freefloat.motion.extrema import ClosestApproach, closest_approach, unwrapped
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.problem import Problem, require_problem
from freefloat.motion.singularity import singular_event
from freefloat.planning.answer import Answer, PhaseResult
from freefloat.planning.reasons import Verdict, reach_message, unreachable, verdict_on
from freefloat.so3 import Array


@dataclass(frozen=True, eq=False)
class SimulatedBranch:
    """The motion of one arm branch.

    Attributes:
        branch: The arm at the start.
        motion: Its motion along the path.
        closest_approach: Closest approach to a dynamic singularity, by the problem's measure.
    """

    branch: ArmBranch
    motion: Motion = field(repr=False)
    closest_approach: ClosestApproach

    @property
    def title(self) -> str:
        """``branch 2 shoulder+ elbow- wrist+``; of redundant arms ``start 2``."""
        number, label = self.branch.index, self.branch.label
        kind = "start" if self.motion.problem.redundant else "branch"
        return f"{kind} {number}" + ("" if label == str(number) else f" {label}")

    @property
    def minimum_margin(self) -> float:
        """The smallest magnitude of the measure; zero for a motion that ends singular."""
        singular = self.motion.ending is Ending.SINGULAR
        return 0.0 if singular else self.closest_approach.value

    @property
    def feasible(self) -> bool:
        """Whether the motion completes and keeps the problem's margin."""
        return self.verdict().feasible

    def verdict(self, results: Iterable[LimitResult] = ()) -> Verdict:
        """The verdict by the margin, and by the limits along the motion."""
        return verdict_on(self.motion, results, self.closest_approach)

    def _outcome(self) -> dict[str, Any]:
        required = self.motion.problem.margin.threshold
        margin = {**self.closest_approach.to_dict(), "required": required, "kept": self.feasible}
        event = singular_event(self.motion)
        return {
            "branch": self.branch.index,
            "completed": self.motion.completed,
            "ended_at": self.motion.final.time,
            "singular": None if event is None else event.to_dict(),
            "min_margin": margin,
        }

    def summary(self) -> dict[str, Any]:
        """The outcome without the states, as a JSON document."""
        start = {"label": self.branch.label, "joints": self.branch.joints.tolist()}
        return {**self._outcome(), **start}

    def to_dict(self) -> dict[str, Any]:
        """The motion as a JSON document."""
        motion, problem = self.motion, self.motion.problem
        redundancy = problem.redundancy or Redundancy()
        return {
            **self._outcome(),
            "ending": motion.ending.value,
            "joint_names": list(problem.model.joint_names),
            "initial": motion.initial.to_dict(),
            "final": motion.final.to_dict(),
            "duration": problem.path.duration,
            "residuals": motion.residuals().to_dict(),
            "redundancy": redundancy.to_dict() if problem.redundant else None,
        }


@dataclass(frozen=True, eq=False)
class Simulation(Answer):
    """The motions of arm branches from one attitude.

    Attributes:
        branches: Every arm branch that reaches the start of the path; or the requested one alone.
        chosen: The requested one; else, of the feasible ones, the one with the largest minimum
            margin that keeps the limits, or, where none does, with the largest minimum margin; or,
            where none is feasible, the one that comes nearest to it.
        limits: Limits checked in addition to the joint ranges; None where none were checked.
        limit_results: Limits along the chosen motion.
        contact: The deepest contact of bodies along the chosen motion; None without contact.
        verdicts: Verdicts on motions whose limits were checked, by the number of their arm branch.
    """

    kind: ClassVar[str] = "motion"

    branches: tuple[SimulatedBranch, ...]
    chosen: SimulatedBranch = field(repr=False)
    limits: Limits | None = None
    limit_results: tuple[LimitResult, ...] = ()
    contact: Contact | None = None
    verdicts: Mapping[int, Verdict] = field(default_factory=dict, repr=False)

    @property
    def problem(self) -> Problem:
        """The problem that was simulated."""
        return self.chosen.motion.problem

    @property
    def motion(self) -> Motion:
        """The chosen motion."""
        return self.chosen.motion

    @property
    def verdict(self) -> Verdict:
        """The verdict on the chosen motion."""
        return self.chosen.verdict(self.limit_results)

    @property
    def feasible(self) -> bool:
        """Whether the chosen motion completes and keeps the margin and the limits."""
        return self.verdict.feasible

    @property
    def reason(self) -> str:
        """What the chosen motion violates first, if anything."""
        return str(self.verdict)

    @property
    def out_of_reach(self) -> str | None:
        """Where the path leads out of reach, with a likely cause; None where it does not."""
        return None if self.chosen.motion.completed else reach_message(self.problem)

    @property
    def phases(self) -> tuple[PhaseResult, ...]:
        """The chosen motion as the only phase."""
        return (PhaseResult(self.chosen.title, "path", self),)

    def to_dict(self) -> dict[str, Any]:
        """The chosen motion, its limits, and all motions in brief, as a JSON document."""
        return {
            **self.chosen.to_dict(),
            "branches": [branch.summary() for branch in self.branches],
            "out_of_reach": self.out_of_reach,
            "limits": [result.to_dict() for result in self.limit_results],
            "contact": self.contact and self.contact.to_dict(),
        }


def simulate(
    problem: Problem,
    attitude: npt.ArrayLike | None = None,
    *,
    heading: float | None = None,
    branch: int | None = None,
    joints: npt.ArrayLike | None = None,
    others: bool = False,
    limits: Limits | None = None,
    stop_at_margin: bool = False,
    tolerance: float = 1e-10,
) -> Simulation:
    """Integrate the motion of every arm branch from one attitude, or of one of them.

    Revolute joints are shifted by multiples of 2 pi into their ranges where possible.

    Args:
        problem: Robot, path and momentum.
        attitude: Attitude of the spacecraft at the start, quaternion x, y, z, w.
        heading: For planar tasks, in place of the attitude: angle from the inertial x axis [rad].
        branch: Integrate the branch with this number; by default all are integrated, and one is
            chosen, see :class:`Simulation`.
        joints: Integrate the branch near these joint values, shape (n,).
        others: Integrate the other branches, too, for comparison with the requested one.
        limits: Check these limits and the joint ranges.
        stop_at_margin: End motions where they reach the problem's margin.
        tolerance: As for :func:`~freefloat.motion.integration.integrate_motion`.

    Raises:
        InputError: If there is no such branch, or the limits are not those of the robot's joints.
        ModelError: If a clearance is required and the robot's shapes cannot be used.
        UnreachableError: If no arm configuration reaches the start of the path.

    Example:
        >>> problem = ff.load_scenario("planar_3dof/parabola").problem()
        >>> simulation = ff.simulate(problem, heading=np.radians(140.0))
        >>> for branch in simulation.branches:
        ...     print(branch.branch.label, branch.motion.completed)
        elbow+ False
        elbow- True
    """
    require_problem(problem)
    attitude = problem.attitude(attitude, heading=heading)
    checker = None if limits is None else LimitChecker(problem, limits)
    branches, requested = _branches(problem, attitude, branch, joints)
    if requested is not None and not others:
        branches = [requested]
    simulated = [
        integrate_from(problem, attitude, start, stop_at_margin=stop_at_margin, tolerance=tolerance)
        for start in branches
    ]
    candidates = _ranked(simulated)
    if requested is not None:
        candidates = [simulated[branches.index(requested)]]
    checked = _within_limits(candidates, checker)
    chosen, results = checked[0]
    contact = deepest_contact(chosen.motion, results)
    verdicts = {entry.branch.index: entry.verdict(results) for entry, results in checked if results}
    return Simulation(tuple(simulated), chosen, limits, results, contact, verdicts)


def chosen_joints(
    problem: Problem, attitude: Array, joints: Array | None, limits: Limits | None
) -> Array:
    """Initial joint values of the motion that :func:`simulate` chooses, shape (n,).

    Arguments and errors are those of :func:`simulate`; contact is not searched for.
    """
    checker = None if limits is None else LimitChecker(problem, limits)
    branches, requested = _branches(problem, attitude, None, joints)
    starts = branches if requested is None else [requested]
    simulated = _ranked([integrate_from(problem, attitude, start) for start in starts])
    return _within_limits(simulated, checker)[0][0].branch.joints


def integrate_branch(problem: Problem, attitude: Array, branch: int) -> SimulatedBranch:
    """The motion of the arm branch with a number, which exists at the attitude (4,)."""
    start = next(entry for entry in problem.branches(attitude) if entry.index == branch)
    return integrate_from(problem, attitude, start)


def integrate_from(
    problem: Problem, attitude: Array, start: ArmBranch, **options: Any
) -> SimulatedBranch:
    """The motion from an arm branch at an attitude (4,); see :func:`integrate_motion`."""
    return simulated_branch(start, integrate_motion(problem, attitude, start.joints, **options))


def simulated_branch(start: ArmBranch, motion: Motion) -> SimulatedBranch:
    """An arm branch with its motion, and that motion's closest approach to a singularity."""
    motion, problem = unwrapped(motion), motion.problem
    approach = closest_approach(motion, problem.margin.measure)
    joints = motion.initial.joints[: problem.model.arm_dof]
    return SimulatedBranch(replace(start, joints=joints), motion, approach)


def _branches(
    problem: Problem, attitude: Array, branch: int | None, joints: npt.ArrayLike | None
) -> tuple[list[ArmBranch], ArmBranch | None]:
    """The arm branches at the start, and the requested one."""
    if branch is not None and joints is not None:
        raise InputError("branch", f"{branch} was given together with joints", "branch or joints")
    branches = list(problem.branches(attitude))
    if not branches:
        raise unreachable(problem, attitude)
    if joints is not None:
        near = problem.branch_near(attitude, joints, branches)
        if near not in branches:
            branches.append(near)
        return branches, near
    if branch is None:
        return branches, None
    numbered = {start.index: start for start in branches}
    if branch not in numbered:
        numbers = ", ".join(map(str, numbered))
        raise InputError("branch", f"there is no branch {branch} here", numbers)
    return branches, numbered[branch]


def _ranked(branches: list[SimulatedBranch]) -> list[SimulatedBranch]:
    """The feasible branches, the best first; where none is, the best of all."""
    ranked = sorted(branches, key=_score, reverse=True)
    return [branch for branch in ranked if branch.feasible] or ranked[:1]


def _within_limits(
    branches: list[SimulatedBranch], checker: LimitChecker | None
) -> list[tuple[SimulatedBranch, tuple[LimitResult, ...]]]:
    """The branches up to the first whose motion keeps the limits, that one first.

    The first without results where limits are not checked.
    """
    if checker is None:
        return [(branches[0], ())]
    checked: list[tuple[SimulatedBranch, tuple[LimitResult, ...]]] = []
    for branch in branches:
        checked.append((branch, checker.results(branch.motion)))
        if not violated(checked[-1][1]):
            return [checked[-1], *checked[:-1]]
    return checked


def _score(branch: SimulatedBranch) -> tuple[bool, float, float]:
    """Completion first; then the minimum margin of complete motions, the time others reach.

    To six digits: the motions of mirrored branches differ by rounding, and the first is preferred.
    """
    completed = branch.motion.completed
    margin = branch.closest_approach.value if completed else 0.0
    return completed, float(f"{margin:.6g}"), float(f"{branch.motion.final.time:.6g}")
