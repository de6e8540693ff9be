"""Simulation of one initial attitude: the motions of arm branches, one of them chosen."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy.typing as npt

from freefloat.ensemble.integrators import precise_motion
from freefloat.errors import InputError, IntegrationError, whole_number
from freefloat.ik.branches import ArmBranch
from freefloat.limits.limits import Contact, LimitChecker, Limits, deepest_contact, limits_for
from freefloat.limits.result import LimitResult, violated
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem, require_problem
from freefloat.planning.answer import Answer, PhaseResult
from freefloat.planning.motions import SimulatedBranch, integrate_from, simulated_branch
from freefloat.planning.reasons import Verdict, reach_message, unreachable
from freefloat.so3 import Array

_logger = logging.getLogger("freefloat")


@dataclass(frozen=True, eq=False)
class Simulation(Answer):
    """The motions of arm branches from one attitude.

    Attributes:
        branches: Every arm branch that reaches the start of the path, without those whose motions
            cannot be integrated; or the requested one alone.
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
        """What the chosen motion violates, if anything."""
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
        heading: In place of the attitude, for planar tasks and on a table: the angle about the
            normal of the plane [rad].
        branch: Integrate the branch with this number; by default all are integrated, and one is
            chosen, see :class:`Simulation`.
        joints: Integrate the branch near these joint values, shape (n,).
        others: Integrate the other branches, too, for comparison with the requested one.
        limits: Check these limits, by default the problem's limits, and the joint ranges.
        stop_at_margin: End motions where they reach the problem's margin.
        tolerance: As for :func:`~freefloat.motion.integration.integrate_motion`.

    Raises:
        InputError: If there is no such branch, or the limits do not belong to the robot's joints.
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
    limits = limits_for(problem, limits)
    checker = None if limits is None else LimitChecker(problem, limits)
    branches, requested = _branches(problem, attitude, branch, joints)
    if requested is not None and not others:
        branches = [requested]
    options: dict[str, Any] = {"stop_at_margin": stop_at_margin, "tolerance": tolerance}
    simulated, asked = _integrated(
        lambda start: integrate_from(problem, attitude, start, **options), branches, requested
    )
    checked = _within_limits(asked or _candidates(simulated), checker)
    chosen, results = checked[0]
    contact = deepest_contact(chosen.motion, results)
    verdicts = {entry.branch.index: entry.verdict(results) for entry, results in checked if results}
    return Simulation(tuple(simulated), chosen, limits, results, contact, verdicts)


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
    if whole_number("branch", branch, 0) not in numbered:
        numbers = ", ".join(map(str, numbered))
        raise InputError("branch", f"there is no branch {branch} here", numbers)
    return branches, numbered[branch]


def _integrated(
    integrate: Callable[[ArmBranch], SimulatedBranch],
    starts: Sequence[ArmBranch],
    requested: ArmBranch | None = None,
) -> tuple[list[SimulatedBranch], list[SimulatedBranch]]:
    """The motions of starts, and of the requested start, if any.

    A motion that cannot be integrated is left out, with a warning.

    Raises:
        IntegrationError: If it is the requested one, or the only one.
    """
    simulated, asked = list[SimulatedBranch](), list[SimulatedBranch]()
    for start in starts:
        try:
            entry = integrate(start)
        except IntegrationError as error:
            if start is requested or (start is starts[-1] and not simulated):
                raise
            _logger.warning("start %d is left out: %s", start.index, error)
            continue
        simulated.append(entry)
        if start is requested:
            asked.append(entry)
    return simulated, asked


def chosen_branch(problem: Problem, attitude: Array) -> ArmBranch:
    """The arm branch that :func:`simulate` chooses at an attitude (4,); errors are the same."""
    starts, _ = _branches(problem, attitude, None, None)
    limits = limits_for(problem, None)
    checker = None if limits is None else LimitChecker(problem, limits)
    simulated, _ = _integrated(
        lambda s: simulated_branch(s, precise_motion(problem, attitude, s.joints)), starts
    )
    return _within_limits(_candidates(simulated), checker)[0][0].branch


def _candidates(simulated: list[SimulatedBranch]) -> list[SimulatedBranch]:
    """The feasible branches, best first; where none is feasible, the best of all."""
    ranked = sorted(simulated, key=_score, reverse=True)
    return [entry for entry in ranked if entry.feasible] or ranked[:1]


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
