"""Arrays of a robot for the kernels, see :mod:`freefloat.dynamics.kernels.equation`."""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.kernels.equation import FACTS, LEVEL
from freefloat.dynamics.momentum import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.rigid_bodies import Body
from freefloat.so3 import Array


def robot_rows(model: FreeFloatingModel) -> Array:
    """Array ``bodies``: a row for the spacecraft and one for each body behind a joint."""
    return np.array([_row(body) for body in model.bodies])


def robot_facts(model: FreeFloatingModel, task: Task) -> Array:
    """Array ``facts``, zero where values of a measure or of a redundant arm belong."""
    facts = np.zeros(FACTS)
    facts[:LEVEL] = [
        model.total_mass, VirtualManipulator.of(model).reach, task.planar, *model.tool.position,
    ]  # fmt: skip
    return facts


def _row(body: Body) -> Array:
    """A body's row; the joint rotation follows Rodrigues' formula."""
    x, y, z = body.axis
    hat = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    P, inertia = body.placement.rotation, body.inertia
    return np.concatenate([
        body.placement.position, P.ravel(), (P @ hat).ravel(), (P @ hat @ hat).ravel(), body.axis,
        [body.prismatic, body.mass], body.centre,
        inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]], [1.0, np.nan],
    ])  # fmt: skip
