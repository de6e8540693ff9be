"""Problems: a robot, a path and the momentum, checked against each other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.plane import Plane
from freefloat.dynamics.redundancy import Redundancy
from freefloat.dynamics.resolved_rates import ResolvedRateSolver
from freefloat.dynamics.system import System
from freefloat.dynamics.tasks import Task, prescribed_rows, require_task, required_plane
from freefloat.dynamics.virtual_manipulator import reach_bound
from freefloat.errors import InputError, require_type
from freefloat.ik.branches import ArmBranch, BranchSets, arm_branches, many_arm_branches
from freefloat.ik.nearest import closest_branches, newton_configuration
from freefloat.ik.several_arms import several_arm_branches
from freefloat.motion.arm_curves import ArmCurves
from freefloat.motion.attitude_values import checked_attitude
from freefloat.motion.margin import Margin
from freefloat.motion.planar_requirements import require_planar
from freefloat.motion.pointing import AttitudeLimits
from freefloat.motion.revolutions import require_few_revolutions
from freefloat.paths.orientation import FreeOrientation
from freefloat.paths.timed_path import TimedPath
from freefloat.robot.model import FreeFloatingModel
from freefloat.rotations import rotation_matrix
from freefloat.scene.scene import Scene
from freefloat.so3 import (
    Array,
    IntArray,
    frozen,
    zeros,
)

Prescribed = tuple[Array, Any, Array | None]
"""Twist of the end-effector, path speed ds/dt, joint rates of further arms that move."""
Prescription = Callable[[float], tuple[Any, ...]]
"""By time: twist, path speed, and joint values and rates of further arms that move."""
_APART = 1e-6
"""Smallest distance of breaks, as a fraction of the duration."""
_NEAR_BRANCH, _SAME_JOINTS = 0.05, 1e-6
"""Largest differences of joint values from those of a near branch, and of the same [rad, m]."""


@dataclass(frozen=True, eq=False)
class Problem:
    """A robot, a path for its end-effector, and the angular momentum of the system.

    Attributes:
        model: Robot.
        path: Pose of the end-effector by time; a :class:`~freefloat.paths.path_stack.PathStack`
            where further arms follow paths of their own.
        task: Prescribed components of the end-effector twist, or its value, such as ``"pose"``.
        momentum: Angular momentum about the centre of mass, inertial axes [N m s], shape (3,).
        margin: Required distance from dynamic singularities.
        redundancy: Null-space motion of a redundant arm; by default the joint rates have the
            smallest Euclidean norm.
        start_joints: Of the arm configurations at the start of the path only the one closest to
            these joint values is considered, shape (n,); all when left out.
        scene: Bodies beside the robot, and the corridor of the end-effector.
        wheel_momentum: Part of the momentum that wheels store, constant in the spacecraft frame
            [N m s], shape (3,): the wheels turn with constant rates relative to the spacecraft, and
            their masses and inertias belong to it.
        arms: Joint curves of further arms that move along these.
        limits: :class:`~freefloat.limits.limits.Limits` that functions keep or check unless others
            are given; None for none. The problem of a scenario has those of the scenario.

    Example:
        >>> model = ff.FreeFloatingModel.from_urdf("planar_2dof")
        >>> line = ff.paths.PolynomialCurve.line([0.9, 0.2, 0.0], [0.6, 0.7, 0.0])
        >>> path = ff.TimedPath(ff.EndEffectorPath(line), ff.Timing(20.0))
        >>> margin = ff.Margin(ff.singularity_measure(model, "planar-position", "gjm"), 0.05)
        >>> problem = ff.Problem(model, path, "planar-position", [0.0, 0.0, 0.1], margin)
        >>> problem.redundant
        False
    """

    model: FreeFloatingModel = field(repr=False)
    path: TimedPath = field(repr=False)
    task: Task
    momentum: Array
    margin: Margin
    redundancy: Redundancy | None = None
    start_joints: Array | None = None
    scene: Scene = field(default=Scene(), repr=False)
    wheel_momentum: Array = field(default_factory=zeros, repr=False)
    arms: ArmCurves = field(default_factory=ArmCurves, repr=False)
    limits: AttitudeLimits | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        require_type("path", self.path, TimedPath, "TimedPath(EndEffectorPath(...), Timing(...))")
        if not self.path.moves:
            raise InputError("path", "its length is zero", "a path that moves or rotates")
        accepted = "Margin(singularity_measure(model, task, name), threshold)"
        require_type("margin", self.margin, Margin, accepted)
        object.__setattr__(self, "momentum", self.system.momentum)
        object.__setattr__(self, "wheel_momentum", self.system.wheels)
        object.__setattr__(self, "task", require_task(self.model, self.task))
        require_type("arms", self.arms, ArmCurves, "ArmCurves({name: ArmCurve(...)})")
        self.arms.require_applicable(self.model, self.path.duration)
        self._require_paths()
        if self.start_joints is not None:
            joints = frozen(self.model.joint_vector(self.start_joints, "start_joints"))
            object.__setattr__(self, "start_joints", frozen(joints[: self.model.arm_dof]))
        if self.redundancy is not None:
            accepted = "Redundancy, such as Redundancy(metric='energy')"
            require_type("redundancy", self.redundancy, Redundancy, accepted)
            self.redundancy.require_applicable(self.model, self.task)
        require_type("scene", self.scene, Scene, "Scene(bodies, corridor)")
        self.scene.require_applicable(self.model, self.path.duration)
        accepted = "Limits, such as Limits(base_rate=0.02), or None"
        require_type("limits", self.limits, AttitudeLimits | None, accepted)
        if self.task.planar:
            require_planar(self.plane, self.system, self.path, self.task)
        require_few_revolutions(self.system, self.path.duration)

    def _require_paths(self) -> None:
        """Raise an InputError unless there is a path for each arm, as the task needs it."""
        names, arms = self.path.arms, tuple(self.model.path_arms)
        if names != arms:
            problem = f"paths of {', '.join(names) or 'no further arm'} were given"
            accepted = f"paths of {', '.join(arms) or 'no further arm'}: PathStack.of(...)"
            raise InputError("robot.arms", problem, accepted)
        keys = ["path", *(f"robot.arms.{name}.law.path" for name in arms)]
        for key, path in zip(keys, self.path.every, strict=True):
            if self.task.prescribes_orientation and isinstance(
                path.path.orientation, FreeOrientation
            ):
                raise InputError(
                    f"{key}.attitude",
                    f"it is missing, task {self.task} needs it",
                    "EndEffectorPath(curve, FixedOrientation(axes)), or another law",
                )

    @cached_property
    def system(self) -> System:
        """The robot with its momentum, wheels and drift."""
        return System(self.model, self.momentum, self.wheel_momentum, self.path.drift)

    @property
    def has_headings(self) -> bool:
        """Whether the spacecraft turns in a plane: of planar tasks, and on a table."""
        return self.task.planar or self.model.on_table

    @cached_property
    def plane(self) -> Plane:
        """The plane in which the spacecraft turns, common to its frame and the inertial frame.

        Raises:
            InputError: If the robot does not stay in one.
        """
        if self.model.on_table and not self.task.planar:
            return Plane.of_normal(np.eye(3)[2])
        return required_plane(self.model, self.task)

    @property
    def arm_joints(self) -> slice:
        """The joints of the arms that follow paths, the first of all."""
        return slice(self.model.arm_dof)

    @property
    def redundant(self) -> bool:
        """Whether the arms that follow paths have more joints than the task has rows."""
        return self.model.arm_dof > len(prescribed_rows(self.model, self.task))

    @property
    def depends_on_timing(self) -> bool:
        """Whether the motion is another one at another speed.

        With momentum or drift the system moves while the end-effector rests; a path in the frame of
        a tumbling body is another one.
        """
        return self.system.rotates or self.path.depends_on_time

    def stretched(self, factor: float) -> Problem:
        """The same problem, all times of its path and its joint curves multiplied by a factor."""
        return replace(self, path=self.path.stretched(factor), arms=self.arms.stretched(factor))

    def replace(self, **changes: Any) -> Problem:
        """The same problem with other attributes, checked again.

        With another model or task, the margin has the measure of these, unless it is given.

        Example:
            >>> problem = ff.load_scenario("planar_2dof/line").problem()
            >>> problem.replace(momentum=[0.0, 0.0, 0.1]).momentum
            array([0. , 0. , 0.1])
        """
        model, task = changes.get("model", self.model), changes.get("task", self.task)
        if "margin" not in changes and (model is not self.model or task != self.task):
            measure = singularity_measure(model, task, self.margin.measure.name)
            changes["margin"] = Margin(measure, self.margin.threshold)
        return replace(self, **changes)

    def with_system(self, system: System) -> Problem:
        """The same problem for another system, whose drift its path has, checked again."""
        return self.replace(
            model=system.model, momentum=system.momentum, wheel_momentum=system.wheels,
            path=self.path.with_drift(system.drift),
        )  # fmt: skip

    def model_at(self, t: float = 0.0) -> FreeFloatingModel:
        """The robot with the arms that follow paths, further arms fixed as at a time [s]."""
        if not self.arms:
            return self.model
        if t not in self._chains:
            self._chains[t] = self._model_at(t)
        return self._chains[t]

    def with_arms_resting(self, t: float) -> Problem:
        """The same problem, further arms on joint curves being fixed as at a time [s]."""
        if not self.arms:
            return self
        chain, limits = self.model_at(t), self.limits
        limits = limits and limits.of_joints(chain.dof)
        return self.replace(model=chain, arms=ArmCurves(), limits=limits)

    def reach(self, t: float = 0.0) -> float:
        """Upper bound of the distance from the centre of mass to the end-effector [m].

        Further arms on joint curves are as at a time [s].
        """
        return reach_bound(self._model_at(t))

    def _model_at(self, t: float) -> FreeFloatingModel:
        return self.model.with_arms_at(self.arms.at(t)) if self.arms else self.model

    @cached_property
    def _chains(self) -> dict[float, FreeFloatingModel]:
        return {}

    @cached_property
    def breaks(self) -> Array:
        """Times [s], rising, at which high derivatives of the path or of joint curves jump."""
        if not self.arms:
            return self.path.breaks
        both, apart = np.union1d(self.path.breaks, self.arms.breaks), _APART * self.path.duration
        both = both[(both > apart) & (both < self.path.duration - apart)]
        return frozen(both[np.diff(both, prepend=0.0) > apart])

    def prescribed(self, t: float | Array, segment: int | IntArray | None = None) -> Prescribed:
        """What the rates at times [s] have to be, with the segments of :meth:`.Timing.s`."""
        twist, speed = self.path.twist_and_speed(t, segment)
        return twist, speed, self.arms.at(t, 1) if self.arms else None

    def prescribed_between(self, start: float, end: float) -> Prescription:
        """What is prescribed between two times [s] without a break between them.

        It is also valid a little beyond.
        """
        twist_and_speed = self.path.prescribed_between(start, end)
        if not self.arms:
            return twist_and_speed
        further = self.arms.prescribed_between(start, end)
        return lambda t: (*twist_and_speed(t), *further(t))

    def all_joints(self, joints: Array, t: float) -> Array:
        """Values of all moving joints (n,) for those of the arm, further arms as at a time [s]."""
        return np.concatenate([joints[: self.model.arm_dof], self.arms.at(t)])

    def resolved_rate_solver(self) -> ResolvedRateSolver:
        """Solver of equation (4) for this problem."""
        return ResolvedRateSolver(self.system, self.task, self.redundancy)

    def attitude(
        self,
        values: npt.ArrayLike | None = None,
        *,
        heading: float | None = None,
        key: str = "attitude",
    ) -> Array:
        """A checked, normalized attitude of the spacecraft.

        Args:
            values: Quaternion x, y, z, w.
            heading: For planar tasks and on a table, in its place: the angle about the normal of
                the plane [rad].
            key: Named in errors.

        Returns:
            The unit quaternion, shape (4,).

        Raises:
            InputError: If it is no unit quaternion or, where the spacecraft turns in a plane, not a
                rotation about its normal; if both or neither are given, or a heading elsewhere.
        """
        plane = self.plane if self.has_headings else None
        return checked_attitude(self.task, plane, values, heading, key)

    def branches(self, attitude: npt.ArrayLike, t: float = 0.0) -> tuple[ArmBranch, ...]:
        """All arm configurations with the end-effector on the path; see also ``start_joints``.

        Args:
            attitude: Attitude of the spacecraft at that time, unit quaternion x, y, z, w.
            t: Time [s].

        Returns:
            The branches; none where the path is out of reach.
        """
        attitude = self.attitude(attitude)
        if self.start_joints is not None or self.path.arms:
            return self.many_branches(attitude[None], t)[0]
        R0 = rotation_matrix(attitude)
        return arm_branches(self.model_at(t), self.path.pose(t).seen_from(R0), self.task)

    def many_branches(
        self, attitudes: Array, t: float = 0.0, branch: int | IntArray | None = None
    ) -> BranchSets:
        """The same for many attitudes (K, 4).

        With the number of an arm branch, or of one for each attitude (K,), others may be missing.
        """
        at = self.model_at(t), *self.poses_seen_from(attitudes, t), self.task
        if self.start_joints is not None and t == 0.0:
            return closest_branches(*at, self.start_joints)
        if not self.path.arms:
            return many_arm_branches(*at)
        only = None if branch is None else np.broadcast_to(branch, len(attitudes))
        return several_arm_branches(*at, only)

    def poses_seen_from(self, attitudes: Array, t: float = 0.0) -> tuple[Array, Array]:
        """Positions (K, 3) and rotations (K, 3, 3) of the path relative to attitudes (K, 4).

        Where E arms follow paths, those of all, (E, K, 3) and (E, K, 3, 3).
        """
        seen = [pose.seen_from_each(attitudes) for pose in self.path.poses(t)]
        if not self.path.arms:
            return seen[0]
        positions, rotations = zip(*seen, strict=True)
        return np.array(positions), np.array(rotations)

    def closest_start(self, attitude: npt.ArrayLike) -> Array | None:
        """Joints (n,) at the start closest to ``start_joints``; None without, or out of reach."""
        if self.start_joints is None:
            return None
        return next((branch.joints for branch in self.branches(attitude)), None)

    def nearest(
        self, joints: Array, branches: Sequence[ArmBranch], within: float = _NEAR_BRANCH
    ) -> ArmBranch | None:
        """The branch nearest to joint values (n,), None if all are farther away [rad, m]."""
        distances = [float(self.model.joint_distance(b.joints, joints)) for b in branches]
        least = min(distances, default=np.inf)
        return branches[distances.index(least)] if least <= within else None

    def branch_near(
        self, attitude: npt.ArrayLike, joints: npt.ArrayLike, branches: Sequence[ArmBranch]
    ) -> ArmBranch:
        """The arm branch near joint values.

        Args:
            attitude: Attitude of the spacecraft at the start, unit quaternion x, y, z, w.
            joints: Joint values within 0.05 rad each, modulo 2 pi, of a branch; for a redundant
                arm, of any configuration on the path.
            branches: The result of :meth:`branches`.

        Raises:
            InputError: Listing the branches when the joints lie near none.
        """
        values = self.model.joint_vector(joints)[: self.model.arm_dof]
        near = self.nearest(values, branches)
        if self.redundant:
            poses = self.poses_seen_from(np.asarray(attitude)[None])
            given = newton_configuration(self.model_at(), *poses, self.task, values)
            if given is not None and self.nearest(values, [given]):
                near = self.nearest(given.joints, branches, _SAME_JOINTS) or given
        if near is not None:
            return near
        raise InputError(
            "joints",
            f"{values.tolist()} is near no arm branch at this attitude",
            f"within {_NEAR_BRANCH} rad each of: "
            + "; ".join(f"{b.index} {np.round(b.joints, 4).tolist()}" for b in branches),
        )


def require_problem(value: object) -> None:
    """Raise an InputError unless the value is a problem."""
    accepted = "a Problem: problem() of a Scenario, such as load_scenario(...).problem()"
    require_type("problem", value, Problem, accepted)
