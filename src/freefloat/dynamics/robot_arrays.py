"""A robot as the arrays that kernels read."""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.kernel_axes import KernelAxes
from freefloat.dynamics.kernels.robot import TOTAL_MASS, FurtherArms, Robot
from freefloat.dynamics.link_frames import (
    LinkFrames,
    in_frame,
    inertial_row,
    link_frames,
    robot_properties,
)
from freefloat.dynamics.measures import unit_of_length
from freefloat.dynamics.redundancy import singular_speed
from freefloat.dynamics.tasks import Task, prescribed_rows
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array

NO_ARMS = FurtherArms(0, 0.0, np.zeros((0, 0, 0)))
"""Where no further arm moves."""


def kernel_robot(model: FreeFloatingModel, task: Task, coefficients: Array | None = None) -> Robot:
    """The arrays of a robot, all moving arms of which follow paths.

    Args:
        model: Robot.
        task: Part of the poses that is prescribed.
        coefficients: Those of the measure ``arm``, shape (T, 2).
    """
    axes, arms = KernelAxes.of(model, task), model.single_arms
    frames = [link_frames(arm) for arm in arms]
    bodies = [entry.bodies.copy() for entry in frames]
    body = model.bodies[0]
    root = inertial_row(body.mass, body.centre, body.inertia)
    if len(arms) > 1:  # each beside the spacecraft alone
        for own, entry in zip(bodies, frames, strict=True):
            own[0] = in_frame(root, entry.base[:3], -entry.base[:3] @ entry.base[3])
    turn = np.eye(3) if axes.plane is None else axes.plane.axes.T
    properties = robot_properties(
        np.array([axes.seen(entry.base) for entry in frames]), np.vstack(bodies),
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
        in_frame(root, turn, np.zeros(3))[None], np.array(rows, dtype=float), len(arms),
        int(beyond[-1]), len(rows), task.planar, model.on_table, task is Task.POINTING,
        singular_speed(task), NO_ARMS,
    )  # fmt: skip


def _tool(first: int, beyond: int, frames: LinkFrames) -> Array:
    """A row of ``Robot.tools``."""
    x, y = frames.across
    return np.concatenate([[first, beyond], frames.tool, x, y, np.cross(x, y)])
