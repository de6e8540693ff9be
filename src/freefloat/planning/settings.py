"""What a search for initial attitudes looks for, and where."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from freefloat.attitude_grids import attitude_grid, attitudes_within, ball_fraction, grid_spacing
from freefloat.dynamics.plane import Plane
from freefloat.errors import InputError, finite_number, number_array, seed_number, whole_number
from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem
from freefloat.planning.objective import Comparison, Objective
from freefloat.planning.objectives import NAMED, objective_of
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, IntArray, angle_between, degrees, frozen, unit_quaternion

if TYPE_CHECKING:  # compiled kernels take half a second to import
    from freefloat.ensemble.feasibility import FeasibilityEvaluator

HEADINGS, PLAN_ATTITUDES = 360, 4096
"""Default numbers of samples of planar and of spatial tasks."""

FEWEST_SAMPLES = 8
"""Smallest accepted number of samples."""
_LARGEST_ANGLE = 4.0 * np.pi
"""Largest present joint angle [rad]: larger ones are degrees."""
_HEADINGS = 2880
"""Headings between which the arm branch closest to the present joints changes once at most."""
_EXACT = 1e-10
"""Accuracy of the headings at which it changes [rad]."""
_ANGLE_ERROR = 1e-9
"""Rounding error of angles [rad]."""


@dataclass(frozen=True, eq=False)
class SearchDomain:
    """All attitudes, or attitudes within an angle of one of them.

    Attributes:
        centre: Quaternion x, y, z, w.
        radius: Largest angle from the centre [rad]; pi for all attitudes.
    """

    centre: Array = field(default_factory=lambda: frozen([0.0, 0.0, 0.0, 1.0]))
    radius: float = np.pi

    @property
    def whole(self) -> bool:
        """Whether the domain has all attitudes."""
        return self.radius >= np.pi

    @property
    def fraction(self) -> float:
        """Fraction of all attitudes in space that the domain has."""
        return ball_fraction(self.radius)

    def contains(self, attitudes: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Which attitudes (..., 4) belong to the domain, shape (...)."""
        return np.asarray(angle_between(attitudes, self.centre) <= self.radius + _ANGLE_ERROR)

    def attitudes(self, count: int, seed: int = 0) -> Array:
        """Evenly distributed attitudes, shape (count, 4)."""
        if self.whole:
            return attitude_grid(count, seed)
        return attitudes_within(self.centre, self.radius, count, seed)

    def spacing(self, count: int) -> float:
        """Side [rad] of a cube with the volume that each of ``count`` attitudes represents."""
        return grid_spacing(count, self.radius)

    def headings(self, count: int, plane: Plane) -> Array:
        """Evenly spread headings [rad], rising, shape (count,); of all, from zero."""
        if self.whole:
            return frozen(np.arange(count) * (2.0 * np.pi / count))
        low, _ = self.heading_limits(plane)
        return frozen(low + (np.arange(count) + 0.5) * (2.0 * self.radius / count))

    def heading_limits(self, plane: Plane) -> tuple[float, float]:
        """First heading [rad], in [0, 2 pi), and last heading of planar attitudes."""
        low = (plane.heading(self.centre) - self.radius) % (2.0 * np.pi)
        return low, low + 2.0 * self.radius


@dataclass(frozen=True, eq=False)
class Search:
    """Objective and domain of a search for initial attitudes.

    Attributes:
        objective: The largest minimum margin, the feasible attitude nearest to ``from_attitude``,
            the one deepest inside the feasible set, or the one with the least turn of the
            spacecraft along the motion: ``margin``, ``nearest``, ``robust`` or ``still``; a
            weighted sum, such as ``{"margin": 1.0, "turn": 0.3}``; or an object of the class
            Objective.
        from_attitude: Present attitude of the spacecraft, x, y, z, w; one of the attitudes tried.
        joints: Present joints of the arm, in chain order or by name [rad or m]: of the arm
            configurations at every attitude only the closest is considered; all when left out.
        within: Only attitudes within this angle of ``from_attitude`` are searched [rad]; all when
            left out.
        samples: Number of attitudes; when left out 360 headings (where no closed form is known),
            4,096 attitudes in space.
        seed: Rotates the grid of attitudes in space.
        spare: Objective nearest: the margin is kept within this angle around the attitude [rad].

    Example:
        >>> problem = ff.load_scenario("planar_3dof/parabola").problem()
        >>> ff.plan(problem, ff.Search("robust")).reason
        'the middle of the widest range, 261.8 degrees wide'
    """

    objective: Objective = NAMED["margin"]
    from_attitude: Array | None = None
    samples: int | None = None
    seed: int = 0
    joints: Mapping[str, float] | npt.ArrayLike | None = None
    within: float | None = None
    spare: float = math.radians(2.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "objective", objective_of(self.objective))
        if self.samples is not None:
            samples = whole_number("search.samples", self.samples, FEWEST_SAMPLES)
            object.__setattr__(self, "samples", samples)
        object.__setattr__(self, "seed", seed_number("search.seed", self.seed))
        accepted = "an angle from 0 to pi / 2"
        spare = finite_number("search.spare", self.spare, accepted, 0.0, np.pi / 2.0)
        object.__setattr__(self, "spare", spare)
        reason = f"objective {self.objective.name}" if self.objective.approaches else None
        if self.from_attitude is not None:
            attitude = unit_quaternion("search.from_attitude", self.from_attitude)
            object.__setattr__(self, "from_attitude", frozen(attitude))
        if isinstance(self.joints, Mapping):
            pairs = self.joints.items()
            plain = {k: v.item() if isinstance(v, np.generic) else v for k, v in pairs}
            object.__setattr__(self, "joints", plain)
        elif self.joints is not None:
            accepted = "present joints, in chain order or by name"
            joints = frozen(number_array("search.joints", self.joints, accepted))
            object.__setattr__(self, "joints", joints)
        if self.within is not None:
            accepted = "an angle above 0, up to pi"
            smallest = np.finfo(float).tiny
            within = finite_number("search.within", self.within, accepted, smallest, np.pi)
            object.__setattr__(self, "within", within)
            reason = "a search within an angle"
        if reason is not None and self.from_attitude is None:
            raise InputError("search.from_attitude", f"it is missing, for {reason}", "x, y, z, w")

    @cached_property
    def domain(self) -> SearchDomain:
        """The attitudes that are searched."""
        if self.from_attitude is None or self.within is None:
            return SearchDomain()
        return SearchDomain(self.from_attitude, self.within)

    @property
    def present(self) -> Array | None:
        """Present attitude: without ``from_attitude``, that of paths in the spacecraft's frame."""
        if self.from_attitude is None and self.joints is not None:
            return frozen([0.0, 0.0, 0.0, 1.0])
        return self.from_attitude

    def comparison(
        self, evaluator: FeasibilityEvaluator, limits: Limits | None, margins: Array
    ) -> Comparison:
        """What the objective compares motions by, with margins of some of them as unit."""
        return Comparison(self.objective, self.from_attitude, limits, evaluator, margins)

    @property
    def required_radius(self) -> float:
        """Angle around the attitude within which the margin is to be kept [rad]."""
        return self.spare if self.objective.approaches else 0.0

    def to_dict(self) -> dict[str, Any]:
        """The keys of a scenario's search, as a JSON document."""
        attitude, joints = self.from_attitude, self.joints
        if isinstance(joints, Mapping):
            joints = dict(joints)
        elif joints is not None:
            joints = np.asarray(joints, dtype=float).tolist()
        return {
            "objective": self.objective.document,
            "seed": self.seed,
            "from_attitude": None if attitude is None else np.asarray(attitude).tolist(),
            "samples": self.samples,
            "joints": joints,
            "within_deg": degrees(self.within),
            "spare_deg": degrees(self.spare),
        }

    def present_state(self, model: FreeFloatingModel) -> tuple[Array, Array]:
        """Present attitude of the spacecraft and joint values of a robot, shape (n,).

        Raises:
            InputError: If one of them is missing, or the joints do not suit the robot.
        """
        attitude, joints = self.from_attitude, self.joints
        if attitude is None or joints is None:
            key = "search.from_attitude" if attitude is None else "search.joints"
            raise InputError(key, "it is missing, for a goal", "the present state")
        attitude = unit_quaternion("search.from_attitude", attitude)
        joints = model.joint_vector(joints, "search.joints")
        require_radians(model, joints)
        return attitude, joints

    def applied_to(self, problem: Problem) -> Problem:
        """The problem, with :attr:`joints` as the joints that the arm starts near.

        Raises:
            InputError: If attitude or joints do not suit it.
        """
        if self.from_attitude is not None:
            problem.attitude(self.from_attitude, key="search.from_attitude")
        if self.joints is None:
            return problem
        joints = problem.model.joint_vector(self.joints, "search.joints")
        require_radians(problem.model, joints)
        return replace(problem, start_joints=joints)


def require_radians(model: FreeFloatingModel, joints: Array) -> None:
    """Raise an InputError where present joints (n,) are so large that they must be degrees."""
    largest = np.where(model.prismatic[: len(joints)], 0.0, np.abs(joints)).max()
    if largest > _LARGEST_ANGLE:
        accepted = "radians of at most two full rotations; 90 degrees are 1.5708"
        raise InputError("search.joints", f"{largest:g} rad was given", accepted)


def branch_changes(problem: Problem, known: Sequence[float] = ()) -> list[float]:
    """Headings [rad] at which another arm branch becomes the closest to the present joints.

    Also changes next to headings that are known, however near each other.
    """

    def closest(headings: npt.NDArray[np.floating]) -> IntArray:
        exist = problem.many_branches(problem.plane.attitudes(headings)).exist
        return np.where(exist.any(axis=1), np.argmax(exist, axis=1), -1)

    even = np.arange(_HEADINGS) * (2.0 * np.pi / _HEADINGS)
    low = np.unique(np.concatenate([even, np.mod(known, 2.0 * np.pi)]))
    width = np.diff(low, append=2.0 * np.pi)
    before = closest(low)
    changed = before != np.roll(before, -1)
    low, before, width = low[changed], before[changed], width[changed]
    while width.max(initial=0.0) > _EXACT:
        width = width / 2.0
        low = low + np.where(closest(low + width) == before, width, 0.0)
    changes: list[float] = (low % (2.0 * np.pi)).tolist()
    return changes
