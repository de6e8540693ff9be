"""One attitude, every arm branch: each followed along the path, one of them chosen."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from freefloat.brief import brief
from freefloat.errors import InputError, UnreachableError
from freefloat.ik.branches import ArmBranch
from freefloat.motion.closest_approach import ClosestApproach, closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.motion.joint_extents import unwrapped
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem, require_problem
from freefloat.motion.reach import light_spacecraft, out_of_reach
from freefloat.so3 import Array


@dataclass(frozen=True, eq=False)
class SimulatedBranch:
    """An arm branch and what became of it.

    Attributes:
        branch: The arm at the start.
        motion: How it followed the path.
        closest_approach: How near it came to a dynamic singularity, by the problem's margin.
    """

    __repr__ = brief

    branch: ArmBranch
    motion: Motion
    closest_approach: ClosestApproach

    @property
    def title(self) -> str:
        """``branch 2 shoulder+ elbow- wrist+``, say; of arms with joints to spare ``start 2``."""
        number, label = self.branch.index, self.branch.label
        problem = self.motion.problem
        kind = "start" if problem.redundant else "branch"
        return f"{kind} {number}" + ("" if label == str(number) else f" {label}")


@dataclass(frozen=True, eq=False)
class Simulation:
    """What an attitude leads to.

    Attributes:
        branches: Every arm branch that reaches the start of the path.
        chosen: The one asked for; else the one that completes with the largest margin, or, where
            none completes, comes nearest to it.
    """

    __repr__ = brief

    branches: tuple[SimulatedBranch, ...]
    chosen: SimulatedBranch

    def named_motions(self) -> dict[str, Motion]:
        """All motions by arm branch, the chosen one first."""
        named: dict[str, Motion] = {}
        for one in sorted(self.branches, key=lambda one: one is not self.chosen):
            name = one.title
            named[name if name not in named else f"{name} ({len(named)})"] = one.motion
        return named


def simulate(
    problem: Problem,
    attitude: npt.ArrayLike,
    *,
    branch: int | None = None,
    joints: npt.ArrayLike | None = None,
    stop_at_margin: bool = False,
    tolerance: float = 1e-10,
) -> Simulation:
    """Follow the path from one attitude with every arm branch.

    Joints are told with the whole turns that keep them inside their ranges, where any do.

    Args:
        problem: Robot, path and momentum.
        attitude: Of the spacecraft at the start, quaternion x, y, z, w.
        branch: Choose the branch with this number.
        joints: Choose the branch near these joint values, shape (n,).
        stop_at_margin: End motions where the problem's margin is used up.
        tolerance: As for :func:`~freefloat.motion.integration.integrate_motion`.

    Raises:
        UnreachableError: If no branch reaches the start of the path.
        InputError: If it is no problem, or the branch asked for does not exist.
    """
    require_problem(problem)
    attitude = problem.attitude("attitude", attitude)
    if branch is not None and joints is not None:
        raise InputError("branch", f"{branch} was given, and joints, too", "branch or joints")
    branches = list(problem.branches(attitude))
    if not branches:
        raise _unreachable(problem, attitude)
    wanted = None
    if joints is not None:
        wanted = problem.branch_near(attitude, joints, branches)
        if wanted not in branches:
            branches.append(wanted)
    elif branch is not None:
        wanted = next((one for one in branches if one.index == branch), None)
        if wanted is None:
            numbers = ", ".join(str(one.index) for one in branches)
            raise InputError("branch", f"there is no branch {branch} here", numbers)
    followed = []
    for one in branches:
        motion = unwrapped(integrate_motion(
            problem, attitude, one.joints, stop_at_margin=stop_at_margin, tolerance=tolerance
        ))  # fmt: skip
        told = replace(one, joints=motion.initial.joints)
        followed.append(
            SimulatedBranch(told, motion, closest_approach(motion, problem.margin.measure))
        )
    if wanted is not None:
        chosen = followed[[one is wanted for one in branches].index(True)]
    else:
        chosen = max(followed, key=_merit)
    return Simulation(tuple(followed), chosen)


def _merit(one: SimulatedBranch) -> tuple[bool, float, float]:
    """Completed first, then the distance kept from singularities, then how far it came.

    To six digits: motions of mirrored branches differ by rounding, and the first one is meant.
    """
    return (
        one.motion.completed,
        float(f"{one.closest_approach.value:.6g}"),
        float(f"{one.motion.final.time:.6g}"),
    )


def _unreachable(problem: Problem, attitude: Array) -> UnreachableError:
    beyond = out_of_reach(problem)
    if beyond is not None and beyond.s == 0.0:
        told = f"{beyond}{light_spacecraft(problem)}"
        return UnreachableError("path", told, "a path that begins within the reach")
    where = problem.path.pose(0.0).position
    return UnreachableError(
        "attitude",
        f"from {np.round(attitude, 6).tolist()} no arm configuration puts the end-effector at the "
        f"start of the path, {np.round(where, 6).tolist()} m from the centre of mass"
        + light_spacecraft(problem),
        "an attitude from which the arm reaches it, or a path that begins nearer",
    )
