"""What further arms that move along joint curves add to the spacecraft."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from freefloat.dynamics.link_frames import inertial_row
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import UPRIGHT, Array


def spacecraft_moments(
    model: FreeFloatingModel, joints: Array, rates: Array
) -> tuple[Array, Array]:
    """Moments of spacecraft and further arms about the origin of the spacecraft frame.

    Args:
        model: Robot.
        joints: Joint values of the further arms [rad or m], shape (..., dof - arm_dof).
        rates: Their rates, of the same shape.

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
