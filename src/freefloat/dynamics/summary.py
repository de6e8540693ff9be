"""Summary of a robot: masses, joints, barycentric lengths and the extremes of its measure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from freefloat.dynamics.measures import (
    SingularityMeasure,
    joint_space_extremes,
    singularity_measure,
)
from freefloat.dynamics.momentum import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.urdf import Severity, UrdfDiagnostic
from freefloat.so3 import Array


@dataclass(frozen=True, eq=False)
class RobotSummary:
    """Summary of a robot and the diagnostics of its URDF.

    Attributes:
        model: The robot.
        task: The task of the extremes.
        measure: The singularity measure of the extremes.
        barycentric_lengths: Of the virtual manipulator [m], shape (n + 1,).
        reach: Largest distance of the end-effector from the centre of mass [m].
        largest_s: Largest value of the measure over the joint space.
        largest_s_at: Joints of it, shape (n,).
        smallest_s: Smallest value of the measure over the joint space.
        diagnostics: Errors and warnings of the URDF.
    """

    model: FreeFloatingModel = field(repr=False)
    task: Task
    measure: SingularityMeasure
    barycentric_lengths: Array
    reach: float
    largest_s: float
    largest_s_at: Array
    smallest_s: float
    diagnostics: tuple[UrdfDiagnostic, ...] = field(default=(), repr=False)

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of ``freefloat info``."""
        model, measure = self.model, self.measure
        return {
            "urdf": model.description.source,
            "end_effector": model.end_effector,
            "total_mass": model.total_mass,
            "dof": model.dof,
            "task": str(self.task),
            "spare_joints": model.dof - len(self.task.rows),
            "joints": [
                {
                    "name": body.joint,
                    "type": "prismatic" if body.prismatic else "revolute",
                    "lower": body.lower if np.isfinite(body.lower) else None,
                    "upper": body.upper if np.isfinite(body.upper) else None,
                }
                for body in model.bodies[1:]
            ],
            "bodies": [
                {
                    "moved_by": body.joint,
                    "mass": body.mass,
                    "centre_of_mass": body.centre.tolist(),
                    "inertia": body.inertia.tolist(),
                }
                for body in model.bodies
            ],
            "barycentric_lengths": self.barycentric_lengths.tolist(),
            "reach": self.reach,
            "measure": {
                "name": measure.name, "definition": measure.definition, "unit": measure.unit
            },
            "s_max": self.largest_s,
            "s_max_at": self.largest_s_at.tolist(),
            "s_min": self.smallest_s,
            "warnings": [
                str(entry) for entry in self.diagnostics if entry.severity == Severity.WARNING
            ],
            "findings": [asdict(entry) for entry in self.diagnostics],
        }  # fmt: skip


def summarize(
    model: FreeFloatingModel,
    task: Task | None = None,
    measure: SingularityMeasure | None = None,
    diagnostics: Sequence[UrdfDiagnostic] = (),
) -> RobotSummary:
    """Summarize a robot.

    Args:
        model: The robot.
        task: Task; that of :func:`natural_task` when left out.
        measure: Singularity measure of the robot; ``gjm`` when left out.
        diagnostics: Errors and warnings of its URDF.
    """
    virtual = VirtualManipulator.of(model)
    task = task or natural_task(model)
    measure = measure or singularity_measure(model, task, "gjm")
    extremes = joint_space_extremes(model, measure)
    return RobotSummary(
        model, task, measure, virtual.lengths, virtual.reach, extremes.largest, extremes.largest_at,
        extremes.smallest, tuple(diagnostics),
    )  # fmt: skip


def natural_task(model: FreeFloatingModel) -> Task:
    """The task with the most rows that an arm can do, planar for planar arms."""
    planar = VirtualManipulator.of(model).is_planar
    tasks = [task for task in Task if task.planar is planar and len(task.rows) <= model.dof]
    return max(tasks, key=lambda task: len(task.rows), default=Task.PLANAR_POSITION)
