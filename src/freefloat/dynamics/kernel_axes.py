"""The spacecraft axes of the kernels: of planar tasks those of the plane, z along its normal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freefloat.dynamics.plane import Plane
from freefloat.dynamics.tasks import Task, required_plane
from freefloat.robot.model import FreeFloatingModel
from freefloat.rotations import Rotation
from freefloat.so3 import Array


@dataclass(frozen=True, eq=False)
class KernelAxes:
    """What the kernels read and write, seen from the spacecraft frame and along their own axes.

    Attributes:
        plane: The plane of a planar task that is not the x-y plane; None where the axes are those
            of the spacecraft frame.
    """

    plane: Plane | None

    @classmethod
    def of(cls, model: FreeFloatingModel, task: Task) -> KernelAxes:
        """The axes of a robot for a task."""
        plane = required_plane(model, task) if task.planar else None
        return cls(None if plane is None or plane.is_level else plane)

    def seen(self, vectors: Array) -> Array:
        """Vectors of the spacecraft frame (..., 3) along the axes."""
        return vectors if self.plane is None else self.plane.seen(vectors)

    def systems(self, columns: Array) -> Array:
        """Rows of momenta, those in wheels, which are seen from the spacecraft, and others."""
        if self.plane is None:
            return columns
        return np.column_stack([columns[:, :3], self.seen(columns[:, 3:6]), columns[:, 6:]])

    def attitudes(self, attitudes: Array, *, back: bool = False) -> Array:
        """Attitudes of these axes for those of the spacecraft, or ``back``, shape (K, 4)."""
        if self.plane is None:
            return attitudes
        turn = Rotation.from_matrix(self.plane.axes)
        x, y, z, w = (turn.inv() if back else turn).as_quat()
        product = np.array([[w, -z, y, -x], [z, w, -x, -y], [-y, x, w, -z], [x, y, z, w]])
        return np.ascontiguousarray(attitudes @ product)
