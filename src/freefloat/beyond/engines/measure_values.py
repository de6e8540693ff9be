"""Values of a singularity measure at many joint values, by compiled code."""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.link_frames import link_frames
from freefloat.dynamics.measures import SingularityMeasure
from freefloat.dynamics.tasks import Task
from freefloat.ensemble.arrays import kernel_measure
from freefloat.ensemble.kernels.commands import measure_all
from freefloat.ensemble.kernels.records import make_workspace
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array


class MeasureValues:
    """Values of the singularity measure of a robot and a task, with their signs."""

    def __init__(self, model: FreeFloatingModel, task: Task, measure: SingularityMeasure) -> None:
        """Convert them to the arrays that the kernels read."""
        frames = link_frames(model)
        self._robot, self._measure = kernel_measure(model, task, measure.name, frames)
        self._workspace = make_workspace(model.dof, len(task.rows))

    def __call__(self, joints: Array) -> Array:
        """Values at joint values of shape (K, n), shape (K,)."""
        values = np.empty(len(joints))
        measure_all(
            self._robot, self._measure, np.ascontiguousarray(joints), self._workspace, values
        )
        return values
