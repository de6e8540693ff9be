"""Angular velocity of the spacecraft for prescribed joint rates, in many configurations."""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.momentum import inertia_matrices
from freefloat.dynamics.system import System
from freefloat.robot.model import FreeFloatingModel
from freefloat.rotations import Rotation
from freefloat.so3 import Array


def base_rates(system: System, attitudes: Array, joints: Array, rates: Array) -> Array:
    """Angular velocity of the spacecraft, ``D^-1 (R0^T h - h_w - Dq q')``, (3) of the paper.

    Args:
        system: Robot and momenta.
        attitudes: Unit quaternions x, y, z, w, shape (..., 4).
        joints: Joint values [rad or m], shape (..., n).
        rates: Joint rates, of the same shape.

    Returns:
        In the spacecraft frame [rad/s], shape (..., 3).

    Example:
        >>> system = ff.System(ff.FreeFloatingModel.from_urdf("planar_2dof"))
        >>> attitude, joints, rates = map(np.array, ([0, 0, 0, 1], [0.3, 0.7], [1.0, 0.0]))
        >>> base_rates(system, attitude, joints, rates).round(4)
        array([ 0.    ,  0.    , -0.4657])
    """
    D, carried = inertia_and_momentum(system.model, joints, rates)
    turned = Rotation.from_quat(attitudes.reshape(-1, 4))
    h = turned.inv().apply(np.array(system.momentum)).reshape(carried.shape)
    return np.asarray(np.linalg.solve(D, (h - system.wheels - carried)[..., None])[..., 0])


def inertia_and_momentum(
    model: FreeFloatingModel, joints: Array, rates: Array
) -> tuple[Array, Array]:
    """``D`` and ``Dq q'`` of (1), in many configurations.

    Args:
        model: Robot.
        joints: Joint values [rad or m], shape (..., n).
        rates: Joint rates, of the same shape.

    Returns:
        In spacecraft axes [kg m², N m s], shapes (..., 3, 3) and (..., 3).
    """
    shape, n = joints.shape[:-1], joints.shape[-1]
    D, Dq = inertia_matrices(model, joints.reshape(-1, n))
    carried = np.einsum("kij,kj->ki", Dq, rates.reshape(-1, n))
    return D.reshape(*shape, 3, 3), carried.reshape(*shape, 3)
