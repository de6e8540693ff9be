"""The generalized Jacobian S* and the system matrix A of a free-floating robot.

Letters are the paper's: ``A`` in (5), ``S`` for S* in (7); ``A_G`` is the centroidal momentum
matrix. Rows are ordered linear before angular. Base columns belong to the base twist in the
spacecraft frame.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy.linalg.blas import dgemm
from scipy.linalg.lapack import dgesv

from freefloat.dynamics.momentum import CARRIED, configuration, conserved, stacked
from freefloat.dynamics.tasks import (
    Task,
    applicable,
    base_rotations,
    prescribed_rows,
    required_plane,
)
from freefloat.errors import InputError, axes_of
from freefloat.robot.joint_values import INERTIAL, configurations, finite_after
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array


def system_matrix(
    model: FreeFloatingModel, joints: npt.ArrayLike, task: Task | str = Task.POSE
) -> Array:
    """The matrix A of (5), which maps the rates to angular momentum and end-effector twist.

    Rows: angular momentum about the centre of mass, then the task's rows of the end-effector twist.
    Columns: spacecraft angular velocity, then rates of the arm that follows the path. Where several
    arms follow paths, rows and columns are stacked arm after arm. All are in the spacecraft
    frame, except the end-effector twist of ``pointing``, which is in the end-effector's frame. The
    linear velocity of the spacecraft is eliminated by zero linear momentum. Planar tasks keep only
    the components along the axes of their plane, see :class:`.Plane`: of the angular momentum and
    of the spacecraft's angular velocity the component about its normal. So does a robot on a
    table, whose spacecraft has no velocity along z.

    Args:
        model: Robot.
        joints: Joint values, shape (n,) or (K, n).
        task: Task or its value, such as ``"position"``.

    Returns:
        Shape (3 + m, 3 + n), for planar tasks and on a table (1 + m, 1 + n); (K, ...) for a stack
        of joints.

    Raises:
        InputError: If there is no such task, it is planar and the robot does not stay in the plane,
            or the joints do not fit the robot.

    Example:
        >>> model = ff.FreeFloatingModel.from_urdf("planar_2dof")
        >>> ff.system_matrix(model, [0.3, 0.7], "planar-position").round(4)
        array([[19.715 ,  9.1811,  2.3222],
               [-1.0787, -1.0787, -0.8146],
               [ 1.8023,  1.3768,  0.5231]])
    """
    task = applicable(model, task)
    A_G, J = _maps(model, joints, task)
    J = J[..., prescribed_rows(model, task), :]
    J = J[..., 3:] - J[..., :3] @ (A_G[..., :3, 3:] / model.total_mass)
    return _system_rows(model, task, A_G, J)


def _system_rows(model: FreeFloatingModel, task: Task, A_G: Array, J: Array) -> Array:
    """The rows of (5), or their derivatives, momentum rows from the centroidal matrix."""
    A = np.concatenate([A_G[..., 3:, 3:], J], axis=-2)
    k = base_rotations(model, task)
    return A[..., 3 - k :, 3 - k :]


def system_matrix_derivative(
    model: FreeFloatingModel,
    joints: npt.ArrayLike,
    rates: npt.ArrayLike,
    task: Task | str = Task.POSE,
) -> Array:
    """Time derivative of :func:`system_matrix` while the joints move.

    Args:
        model: Robot.
        joints: Joint values, shape (n,) or (K, n).
        rates: Joint rates [rad/s or m/s], of the shape of the joints.
        task: Task or its value, such as ``"position"``.

    Returns:
        The derivative, of the shape of the matrix.

    Raises:
        InputError: As :func:`system_matrix`; if the rates have another shape than the joints.
    """
    return system_matrix_with_derivative(model, joints, rates, applicable(model, task))[1]


def system_matrix_with_derivative(
    model: FreeFloatingModel, joints: npt.ArrayLike, rates: npt.ArrayLike, task: Task
) -> tuple[Array, Array]:
    """:func:`system_matrix` and :func:`system_matrix_derivative` from the same kinematics."""
    if np.shape(rates) != np.shape(joints):
        problem = f"shape {np.shape(rates)} was given"
        raise InputError("rates", problem, f"the shape of the joints, {np.shape(joints)}")
    A_G, J, dA_G, dJ = _map_derivatives(model, joints, rates, task)
    rows, linear = prescribed_rows(model, task), A_G[..., :3, 3:] / model.total_mass
    J, dJ = J[..., rows, :], dJ[..., rows, :]
    dJ = dJ[..., 3:] - dJ[..., :3] @ linear - J[..., :3] @ (dA_G[..., :3, 3:] / model.total_mass)
    J = J[..., 3:] - J[..., :3] @ linear
    return _system_rows(model, task, A_G, J), _system_rows(model, task, dA_G, dJ)


def generalized_jacobian(
    model: FreeFloatingModel, joints: npt.ArrayLike, task: Task | str = Task.POSE
) -> Array:
    """The generalized Jacobian S* of (7), after Umetani and Yoshida (1989).

    Args:
        model: Robot.
        joints: Joint values, shape (n,) or (K, n).
        task: Task or its value, such as ``"position"``.

    Returns:
        The task's rows, shape (..., m, n), of the end-effector twist [m/s; rad/s], in the frame of
        the spacecraft (``pointing``: in the end-effector's; planar tasks: along the axes of their
        :class:`.Plane`), per joint rate of the arm that follows the path, while the momentum is
        zero. Where several arms follow paths, rows and columns are stacked arm after arm.

    Raises:
        InputError: If there is no such task, it is planar and the robot does not stay in the plane,
            or the joints do not fit the robot.

    Example:
        >>> model = ff.FreeFloatingModel.from_urdf("planar_2dof")
        >>> ff.generalized_jacobian(model, [0.5, 1.0], "planar-position").round(4)
        array([[-0.772 , -0.8337],
               [ 0.2823, -0.0525]])
    """
    task = applicable(model, task)
    A_G, J = _maps(model, joints, task)
    if A_G.ndim == 3:
        base = np.linalg.solve(A_G[..., :6], A_G[..., 6:])
        return (J[..., 6:] - J[..., :6] @ base)[:, prescribed_rows(model, task)]
    A_G = np.asfortranarray(A_G)  # solved in place
    _, _, base, singular = dgesv(A_G[:, :6], A_G[:, 6:], 1, 1)
    if singular:
        raise np.linalg.LinAlgError("the inertia matrix of the spacecraft's rates is singular")
    S: Array = dgemm(-1.0, J[:, :6], base, 1.0, J[:, 6:])
    return S if task is Task.POSE else S[prescribed_rows(model, task)]


def generalized_determinant(
    model: FreeFloatingModel, joints: npt.ArrayLike, task: Task | str = Task.POSE
) -> Any:
    """Det S* of (6) for arms with as many joints as task rows, without forming S*.

    It is the determinant of the momentum and end-effector rows over all rates, divided by the
    determinant of the momentum matrix's base block: the total mass cubed, on a table squared, times
    det D.

    Args:
        model: Robot.
        joints: Joint values, shape (n,) or (K, n).
        task: Task or its value, such as ``"position"``.

    Returns:
        A number, or shape (K,).

    Raises:
        InputError: As :func:`generalized_jacobian`; if the arm has more or fewer joints.
    """
    task = applicable(model, task)
    rows = prescribed_rows(model, task)
    if len(rows) != model.arm_dof:
        raise InputError(
            "task",
            f"{task} prescribes {len(rows)} rates, the arm has {model.arm_dof} joints",
            "as many joints as rates; for redundant arms singularity_measure(model, task, 'gjm')",
        )
    A_G, J = _maps(model, joints, task)
    M = np.concatenate([A_G, J[..., rows, :]], axis=-2)
    D = A_G[..., 3:, 3:6]
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = D.tolist() if D.ndim == 2 else np.moveaxis(D, 0, -1)
    det_D = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    translations = 2 if model.on_table else 3
    return np.linalg.det(M) / (model.total_mass**translations * det_D)


def _maps(model: FreeFloatingModel, joints: npt.ArrayLike, task: Task) -> tuple[Array, Array]:
    """The momentum matrix in the spacecraft frame and the end-effector Jacobian, or stacks of them.

    On a table, rows of the momentum that it carries are the rates of the spacecraft instead.
    The columns belong to the spacecraft and to the arms that follow paths. The Jacobians of the
    arms are stacked, shape (6 times their number, 6 + n). Rows of planar tasks, and the
    spacecraft's columns, are along the axes of the plane.
    """
    robot, data, axes = model.pin_model, model.scratch, task.reference_frame
    frames = model.frame_ids
    if (getattr(joints, "ndim", None) or axes_of(joints)) == 2:  # the second costs more
        rows = configurations(joints, model.dof)
        A_G, J = np.empty((2, len(rows), 6, 6 + model.dof))
        J = np.repeat(J, len(frames), axis=1)
        for k, q in enumerate(np.hstack([np.tile(INERTIAL, (len(rows), 1)), rows])):
            A_G[k] = pin.computeCentroidalMap(robot, data, q)
            for i, frame in enumerate(frames):
                J[k, 6 * i : 6 * i + 6] = pin.getFrameJacobian(robot, data, frame, axes)
    else:
        q = finite_after(INERTIAL, "joints", joints, model.dof)
        A_G = pin.computeCentroidalMap(robot, data, q)
        J = pin.getFrameJacobian(robot, data, frames[0], axes)
        if model.path_arms:
            others = [pin.getFrameJacobian(robot, data, frame, axes) for frame in frames[1:]]
            J = np.vstack([J, *others])
    if model.on_table:
        A_G = conserved(model, A_G)
    if model.arms:
        A_G, J = A_G[..., : 6 + model.arm_dof], J[..., : 6 + model.arm_dof]
    return (A_G, J) if not task.planar else (_in_plane(model, A_G), _in_plane(model, J))


def _in_plane(model: FreeFloatingModel, M: Array) -> Array:
    """A matrix of :func:`_maps` along the axes of the plane of a planar robot."""
    if (plane := required_plane(model, Task.PLANAR_POSE)).is_level:
        return M
    M = np.moveaxis(plane.rows(np.moveaxis(M, -2, 0)), 0, -2)
    M[..., :6] = np.moveaxis(plane.rows(np.moveaxis(M[..., :6], -1, 0)), 0, -1)
    return M


def _map_derivatives(
    model: FreeFloatingModel, joints: npt.ArrayLike, rates: npt.ArrayLike, task: Task
) -> tuple[Array, ...]:
    """The matrices of :func:`_maps` and their time derivatives, or stacks of them."""
    robot, data, axes = model.pin_model, model.scratch, task.reference_frame

    def matrices(joints: Array, rates: Array) -> tuple[Array, ...]:
        q, v = configuration(model, joints), finite_after(np.zeros(6), "rates", rates, model.dof)
        dJ = [pin.frameJacobianTimeVariation(robot, data, q, v, k, axes) for k in model.frame_ids]
        J = [pin.getFrameJacobian(robot, data, frame, axes) for frame in model.frame_ids]
        dA_G = pin.computeCentroidalMapTimeVariation(robot, data, q, v)
        return data.Ag, np.concatenate(J), dA_G, np.concatenate(dJ)

    A_G, J, dA_G, dJ = stacked(matrices, joints, rates)
    velocity = A_G[..., :3, 6:] @ np.asarray(rates)[..., None] / model.total_mass
    # Pinocchio differentiates about a fixed point; the centre of mass moves in the spacecraft frame
    drift = np.cross(velocity, A_G[..., :3, :], axis=-2)
    dA_G = np.concatenate([dA_G[..., :3, :], dA_G[..., 3:, :] - drift], axis=-2)
    if model.on_table:
        A_G, dA_G[..., CARRIED, :] = conserved(model, A_G), 0.0
    columns = slice(6 + model.arm_dof)
    selected = tuple(M[..., columns] for M in (A_G, J, dA_G, dJ))
    return tuple(_in_plane(model, M) for M in selected) if task.planar else selected
