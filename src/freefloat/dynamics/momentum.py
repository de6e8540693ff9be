"""Momentum matrices and the end-effector Jacobian of a free-floating robot.

Letters are the paper's: ``D``, ``Dq`` in (1), ``J`` in (2); ``A_G`` is the centroidal momentum
matrix (Orin and Goswami 2008). Rows are ordered linear before angular. Base columns belong to the
base twist in the spacecraft frame.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from freefloat.errors import axes_of
from freefloat.robot.joint_values import INERTIAL, configuration_vector, finite_after
from freefloat.robot.model import FreeFloatingModel, require_model
from freefloat.so3 import UPRIGHT, Array

CARRIED = [2, 3, 4]
"""Rows of the momentum that a table carries: along z, about x and y."""


def momentum_map(
    model: FreeFloatingModel, joints: npt.ArrayLike, attitude: npt.ArrayLike = UPRIGHT
) -> Array:
    """The centroidal momentum matrix.

    Args:
        model: Robot.
        joints: Joint values, shape (n,) or (K, n).
        attitude: Unit quaternion x, y, z, w, or K of them; at the identity the rows are in the
            spacecraft frame.

    Returns:
        Shape (..., 6, 6 + n). Its product with ``[base twist; joint rates]`` is the linear momentum
        [N s] and the angular momentum about the centre of mass [N m s], inertial frame. The base
        twist, ``[linear; angular]`` at the root link's origin, is in the spacecraft frame.

    Raises:
        InputError: If the joints do not fit the robot, or the attitude is no unit quaternion.
    """

    def matrix(*state: Array) -> tuple[Array]:
        q = configuration(model, *state)
        return (np.array(pin.computeCentroidalMap(model.pin_model, model.scratch, q)),)

    return stacked(matrix, *((joints,) if attitude is UPRIGHT else (joints, attitude)))[0]


def mass_matrix(model: FreeFloatingModel, joints: npt.ArrayLike) -> Array:
    """The mass matrix, base twist in the spacecraft frame first, shape (6 + n, 6 + n)."""
    q = configuration(model, joints)
    upper = np.triu(pin.crba(model.pin_model, model.scratch, q))
    return np.asarray(upper + np.triu(upper, 1).T)


def end_effector_jacobian(
    model: FreeFloatingModel, joints: npt.ArrayLike, attitude: npt.ArrayLike = UPRIGHT
) -> Array:
    """Jacobian of the end-effector with respect to base and joints.

    Args:
        model: Robot.
        joints: Joint values, shape (n,).
        attitude: Unit quaternion x, y, z, w; at the identity the rows are in the spacecraft frame.

    Returns:
        Shape (6, 6 + n). Its product with ``[base twist; joint rates]`` is the end-effector twist
        [m/s; rad/s] in the inertial frame. The base twist, ``[linear; angular]`` at the root link's
        origin, is in the spacecraft frame.

    Raises:
        InputError: If the joints do not fit the robot, or the attitude is no unit quaternion.
    """
    q = configuration(model, joints, attitude)
    return np.array(
        pin.computeFrameJacobian(
            model.pin_model, model.scratch, q, model.frame_id, pin.LOCAL_WORLD_ALIGNED
        )
    )


def inertia_matrices(model: FreeFloatingModel, joints: npt.ArrayLike) -> tuple[Array, Array]:
    """D and Dq of (1): angular momentum per spacecraft rate and per joint rate.

    Both are about the system's centre of mass, in the spacecraft frame, at zero linear momentum.

    Args:
        model: Robot.
        joints: Joint values, shape (n,) or (K, n).

    Returns:
        ``D`` of shape (..., 3, 3) and ``Dq`` of shape (..., 3, n) [kg m²].

    Raises:
        InputError: If the joints do not fit the robot.

    Example:
        >>> model = ff.FreeFloatingModel.from_urdf("planar_2dof")
        >>> D, Dq = ff.inertia_matrices(model, [0.3, 0.7])
        >>> D[2, 2].round(4), Dq[2].round(4)
        (np.float64(19.715), array([9.1811, 2.3222]))
    """
    A_G = momentum_map(model, joints)
    return A_G[..., 3:, 3:6], A_G[..., 3:, 6:]


def conserved(model: FreeFloatingModel, A_G: Array) -> Array:
    """A momentum matrix (..., 6, 6 + n) of what is conserved.

    On a table, rows of the momentum that it carries select the spacecraft's rates, which are zero.
    """
    if not model.on_table:
        return A_G
    A_G = np.array(A_G)
    A_G[..., CARRIED, :] = np.eye(*A_G.shape[-2:])[CARRIED]
    return A_G


def conserved_inertias(model: FreeFloatingModel, joints: npt.ArrayLike) -> tuple[Array, Array]:
    """D and Dq as :func:`inertia_matrices`, of what is conserved: see :func:`conserved`."""
    A_G = conserved(model, momentum_map(model, joints))
    return A_G[..., 3:, 3:6], A_G[..., 3:, 6:]


def configuration(
    model: FreeFloatingModel, joints: npt.ArrayLike, attitude: npt.ArrayLike = UPRIGHT
) -> Array:
    """Pinocchio's configuration vector with the root link at the inertial frame's origin."""
    require_model(model)
    if attitude is UPRIGHT:
        return finite_after(INERTIAL, "joints", joints, model.dof)
    return configuration_vector(attitude, joints, model.dof)


def stacked(
    function: Callable[..., tuple[Array, ...]], *vectors: npt.ArrayLike
) -> tuple[Array, ...]:
    """Matrices that are functions of vectors (n,), or stacks of them for vectors (K, n)."""
    if axes_of(vectors[0]) != 2:
        return function(*vectors)
    rows: list[Any] = [*zip(*vectors, strict=True)]
    any_row = rows[0] if rows else [np.eye(np.shape(vector)[1])[-1] for vector in vectors]
    stacks = tuple(np.empty((len(rows), *M.shape)) for M in function(*any_row))
    for k, row in enumerate(rows):
        for stack, M in zip(stacks, function(*row), strict=True):
            stack[k] = M
    return stacks
