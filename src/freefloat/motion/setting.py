"""Settings: what there is, a robot with its momentum and the bodies around it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.measures import SingularityMeasure, singularity_measure
from freefloat.dynamics.plane import Plane
from freefloat.dynamics.summary import natural_task
from freefloat.dynamics.system import System
from freefloat.dynamics.tasks import Task, prescribed_rows, required_plane
from freefloat.dynamics.virtual_manipulator import reach_bound
from freefloat.errors import InputError, finite_number, require_type
from freefloat.motion.joint_curves import ArmCurves
from freefloat.motion.margin import Margin
from freefloat.motion.pointing import AttitudeLimits
from freefloat.robot.model import FreeFloatingModel
from freefloat.scene.scene import Scene
from freefloat.so3 import Array, frozen, unit_quaternion


class Setting:
    """A robot with its momentum, its limits and the bodies around it.

    A :class:`.Problem` adds a path, which a :class:`JointSetting` lacks. The attributes are as in
    :class:`.Problem`.
    """

    model: FreeFloatingModel
    momentum: Array
    wheel_momentum: Array
    drift: Array
    scene: Scene
    arms: ArmCurves
    limits: AttitudeLimits | None
    task: Task
    margin: Margin

    @cached_property
    def system(self) -> System:
        """The robot with its momentum, wheels and drift."""
        return System(self.model, self.momentum, self.wheel_momentum, self.drift)

    def _require_setting(self) -> None:
        """Raise an InputError unless the parts are of their kinds; keep checked vectors."""
        vectors = self.system.momentum, self.system.wheels, self.system.drift
        for name, vector in zip(("momentum", "wheel_momentum", "drift"), vectors, strict=True):
            object.__setattr__(self, name, vector)
        require_type("scene", self.scene, Scene, "Scene(bodies, corridor)")
        accepted = "Limits, such as Limits(base_rate=0.02), or None"
        require_type("limits", self.limits, AttitudeLimits | None, accepted)

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
    def dof(self) -> int:
        """Number of joints that equation (4) solves for; time gives those on joint curves."""
        return self.model.arm_dof

    @property
    def redundant(self) -> bool:
        """Whether equation (4) solves for more joints than the task has rows."""
        return self.dof > len(prescribed_rows(self.model, self.task))

    @property
    def robot_varies(self) -> bool:
        """Whether the robot depends on time: joints are on joint curves."""
        return bool(self.arms)

    def solved_joints(self, joints: Array) -> Array:
        """Values or rates (..., dof) that (4) solves for, of all joints or of the solved joints."""
        return joints[..., : self.dof] if joints.shape[-1] == self.model.dof else joints

    def joints_at(self, t: float | Array, joints: Array) -> Array:
        """Values (..., n) of all joints at times (...) [s], for joints that (4) solves for."""
        return np.concatenate([self.solved_joints(joints), self.arms.at(t)], axis=-1)

    def model_at(self, t: float = 0.0) -> FreeFloatingModel:
        """The robot with the arms that follow paths, further arms fixed as at a time [s]."""
        models, t = self._models_at_times, t if self.robot_varies else 0.0
        return models.get(t) or models.setdefault(t, self._model_at(t))

    def _model_at(self, t: float) -> FreeFloatingModel:
        return self.model.with_arms_at(self.arms.at(t))

    @cached_property
    def _models_at_times(self) -> dict[float, FreeFloatingModel]:
        return {}

    def reach(self, t: float = 0.0) -> float:
        """Upper bound at a time [s] of the end-effector's distance from the centre of mass [m]."""
        return reach_bound(self._model_at(t))

    @property
    def drifts(self) -> bool:
        """Whether the centre of mass moves."""
        return bool(self.drift.any())

    def origin(self, t: float | Array) -> Array:
        """Place of the centre of mass at time zero from its place at times t [s], [m], (..., 3)."""
        return np.multiply.outer(t, -self.drift)

    def replace(self, **changes: Any) -> Self:
        """A copy with other attributes, checked again.

        With another model or task, the margin has their measure, unless a margin is given.

        Example:
            >>> problem = ff.load_scenario("planar_2dof/line").problem()
            >>> problem.replace(momentum=[0.0, 0.0, 0.1]).momentum
            array([0. , 0. , 0.1])
        """
        model, task = changes.get("model", self.model), changes.get("task", self.task)
        if "margin" not in changes and (model is not self.model or task != self.task):
            measure = singularity_measure(model, task, self.margin.measure.name)
            changes["margin"] = Margin(measure, self.margin.threshold)
        return replace(self, **changes)  # type: ignore[type-var]

    def attitude(
        self,
        values: npt.ArrayLike | None = None,
        *,
        heading: float | None = None,
        key: str = "attitude",
    ) -> Array:
        """A checked attitude of the spacecraft: a unit quaternion, shape (4,).

        Args:
            values: Quaternion x, y, z, w.
            heading: For planar tasks and on a table, in its place: the angle about the normal of
                the plane [rad].
            key: Named in errors.

        Raises:
            InputError: If it is no unit quaternion or, where the spacecraft turns in a plane, not a
                rotation about its normal; if both or neither are given, or a heading elsewhere.
        """
        plane, accepted = self.plane if self.has_headings else None, "an attitude x, y, z, w"
        if plane is not None:
            accepted += f" or a heading about {plane.axis} [rad]"
        if heading is not None:
            if values is not None or plane is None:
                beside = (
                    f"for the task {self.task}" if values is None else "together with an attitude"
                )
                raise InputError("heading", f"it was given {beside}", accepted)
            return frozen(plane.attitudes(finite_number("heading", heading, "a finite angle")))
        if values is None:
            raise InputError(key, "it is missing", accepted)
        return unit_quaternion(key, values) if plane is None else plane.checked(key, values)


@dataclass(frozen=True, eq=False)
class JointSetting(Setting):
    """The setting of motions whose joints are prescribed.

    Attributes are as in :class:`.Problem`; ``task`` and ``margin`` say which measure is shown,
    without a smallest magnitude, and the scene is seen from the centre of mass at the start.
    """

    model: FreeFloatingModel = field(repr=False)
    momentum: Array
    wheel_momentum: Array
    drift: Array
    scene: Scene = field(repr=False)
    limits: AttitudeLimits | None = field(repr=False)
    task: Task
    margin: Margin
    arms: ArmCurves = field(default_factory=ArmCurves, repr=False)

    def __post_init__(self) -> None:
        self._require_setting()

    @classmethod
    def of(
        cls,
        system: System,
        scene: Scene,
        limits: AttitudeLimits | None = None,
        task: Task | None = None,
        measure: SingularityMeasure | None = None,
    ) -> JointSetting:
        """The setting of a system and its scene, by default with det S* of :func:`natural_task`."""
        model = system.model
        task = natural_task(model) if task is None else task
        measure = singularity_measure(model, task, "gjm") if measure is None else measure
        vectors, margin = (system.momentum, system.wheels, system.drift), Margin(measure, 0.0)
        return cls(model, *vectors, scene, limits, task, margin)
