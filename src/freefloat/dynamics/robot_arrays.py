"""A robot as the arrays that kernels read, and the axes of these arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from freefloat.dynamics.denavit_hartenberg import (
    LinkFrames,
    in_frame,
    inertial_row,
    link_frames,
    robot_properties,
)
from freefloat.dynamics.kernels.robot import TOTAL_MASS, FurtherArms, Robot
from freefloat.dynamics.measures import unit_of_length
from freefloat.dynamics.plane import LEVEL, Plane
from freefloat.dynamics.redundancy import singular_speed
from freefloat.dynamics.tasks import Task, prescribed_rows, required_plane
from freefloat.robot.model import FreeFloatingModel
from freefloat.rotations import Rotation
from freefloat.so3 import UPRIGHT, Array

NO_ARMS = FurtherArms(0, 0.0, np.zeros((0, 0, 0)))
"""Where no further arm moves."""


@dataclass(frozen=True, eq=False)
class KernelAxes:
    """What the kernels read and write, seen from the spacecraft frame and along their own axes.

    Their z is along the normal of the plane of a planar task, otherwise of the x-y plane.
    """

    plane: Plane

    @classmethod
    def of(cls, model: FreeFloatingModel, task: Task) -> KernelAxes:
        """The axes of a robot for a task."""
        return cls(required_plane(model, task) if task.planar else LEVEL)

    def systems(self, columns: Array) -> Array:
        """Rows of momenta, wheel momenta, turned from the spacecraft into the axes, and others."""
        return np.column_stack([columns[:, :3], self.plane.seen(columns[:, 3:6]), columns[:, 6:]])

    def attitudes(self, attitudes: Array, *, back: bool = False) -> Array:
        """Attitudes of these axes for attitudes of the spacecraft, or ``back``, shape (K, 4)."""
        if self.plane.is_level:
            return attitudes
        turn = Rotation.from_matrix(self.plane.axes)
        x, y, z, w = (turn.inv() if back else turn).as_quat()
        product = np.array([[w, -z, y, -x], [z, w, -x, -y], [-y, x, w, -z], [x, y, z, w]])
        return np.ascontiguousarray(attitudes @ product)


def kernel_robot(model: FreeFloatingModel, task: Task, coefficients: Array | None = None) -> Robot:
    """The arrays of a robot, all moving arms of which follow paths.

    Args:
        model: Robot.
        task: Part of the poses that is prescribed.
        coefficients: Coefficients of the measure ``arm``, shape (T, 2).
    """
    plane, arms = KernelAxes.of(model, task).plane, model.single_arms
    frames = [link_frames(arm) for arm in arms]
    bodies = [entry.bodies.copy() for entry in frames]
    body = model.bodies[0]
    root = inertial_row(body.mass, body.centre, body.inertia)
    if len(arms) > 1:  # each beside the spacecraft alone
        for own, entry in zip(bodies, frames, strict=True):
            own[0] = in_frame(root, entry.base[:3], -entry.base[:3] @ entry.base[3])
    properties = robot_properties(
        np.array([plane.seen(entry.base) for entry in frames]), np.vstack(bodies),
        unit_of_length(arms[0], task),
        np.zeros((0, 2)) if coefficients is None else coefficients,
    )  # fmt: skip
    properties[TOTAL_MASS] -= (len(arms) - 1) * body.mass
    rows = prescribed_rows(model, task)
    beyond = np.cumsum([arm.dof for arm in arms])
    return Robot(
        np.vstack([entry.joints for entry in frames]), properties,
        np.array([_tool(end - arm.dof, end, entry)
                  for end, arm, entry in zip(beyond, arms, frames, strict=True)]),
        in_frame(root, plane.axes.T, np.zeros(3))[None], np.array(rows, dtype=float), len(arms),
        int(beyond[-1]), len(rows), task.planar, model.on_table, task is Task.POINTING,
        singular_speed(task), NO_ARMS,
    )  # fmt: skip


def _tool(first: int, beyond: int, frames: LinkFrames) -> Array:
    """A row of ``Robot.tools``."""
    x, y = frames.across
    return np.concatenate([[first, beyond], frames.tool, x, y, np.cross(x, y)])


def spacecraft_moments(
    model: FreeFloatingModel, joints: Array, rates: Array
) -> tuple[Array, Array]:
    """Moments of spacecraft and further arms about the origin of the spacecraft frame.

    Args:
        model: Robot.
        joints: Joint values of the further arms [rad or m], shape (..., dof - arm_dof).
        rates: Rates of these joints, of the same shape.

    Returns:
        Mass, first moment and inertia as :func:`.inertial_row` returns them, shape (..., 10), and
        the angular momentum relative to the spacecraft [N m s], shape (..., 3).
    """
    shape, data = joints.shape[:-1], model.pin_model.createData()
    q, v = np.zeros(7 + model.dof), np.zeros(6 + model.dof)
    q[3:7] = UPRIGHT
    count = int(np.prod(shape))
    masses, levers = np.empty((count, 2)), np.empty((count, 2, 3))
    inertias = np.empty((count, 2, 3, 3))
    angular, centres, linear = np.empty((3, count, 3))
    states = joints.reshape(count, -1), rates.reshape(count, -1)
    for k, (values, speeds) in enumerate(zip(*states, strict=True)):
        q[7 + model.arm_dof :], v[6 + model.arm_dof :] = values, speeds
        pin.ccrba(model.pin_model, data, q, v)
        for part, inertia in enumerate((data.oYcrb[1], data.oYcrb[2])):  # of all, and of the arm
            masses[k, part], levers[k, part] = inertia.mass, inertia.lever
            inertias[k, part] = inertia.inertia
        angular[k], centres[k], linear[k] = data.hg.angular, data.com[0], data.hg.linear
    rows = inertial_row(masses, levers, inertias)
    momentum = angular + np.cross(centres, linear)
    return (rows[:, 0] - rows[:, 1]).reshape(*shape, 10), momentum.reshape(*shape, 3)
