"""Momentum and the generalized Jacobian: how a drifting robot answers to its own joints.

Letters are the paper's: ``D``, ``Dq`` in (1), ``J`` in (2), ``A`` in (5), ``S`` for S* in (7). Rows
are ordered linear before angular. Base columns belong to the base twist in the spacecraft frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy.linalg.lapack import dgesv, dgetrf, dtrtrs

from freefloat.dynamics.null_space import NullSpaceMotion
from freefloat.dynamics.redundancy import Redundancy
from freefloat.errors import InputError, member
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, finite_vector

_IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
_BASE = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
"""Position and attitude of a spacecraft whose axes are the inertial ones."""


class Task(StrEnum):
    """What of the end-effector's motion is prescribed.

    The planar tasks are those of arms that move in the x-y plane of the inertial frame, with the
    spacecraft turning about z.
    """

    POSE = "pose"
    POSITION = "position"
    PLANAR_POSE = "planar-pose"
    PLANAR_POSITION = "planar-position"

    @classmethod
    def of(cls, given: Task | str) -> Task:
        """A task, or the one with that value.

        Raises:
            InputError: Listing the tasks where there is none.
        """
        return member("task", cls, given)

    @property
    def rows(self) -> list[int]:
        """Rows of the end-effector twist ``[linear; angular]`` that are prescribed."""
        return {
            Task.POSE: [0, 1, 2, 3, 4, 5],
            Task.POSITION: [0, 1, 2],
            Task.PLANAR_POSE: [0, 1, 5],
            Task.PLANAR_POSITION: [0, 1],
        }[self]

    @property
    def planar(self) -> bool:
        """Whether everything happens in the x-y plane."""
        return self in (Task.PLANAR_POSE, Task.PLANAR_POSITION)

    @property
    def turns(self) -> bool:
        """Whether the attitude of the end-effector is prescribed, too."""
        return self in (Task.POSE, Task.PLANAR_POSE)


def refuse_too_few_joints(model: FreeFloatingModel, task: Task) -> None:
    """Raise an InputError if a task prescribes more rates than the arm has joints."""
    if len(task.rows) > model.dof:
        fitting = [str(other) for other in Task if len(other.rows) <= model.dof]
        raise InputError(
            "task",
            f"{task} prescribes {len(task.rows)} rates, the arm has {model.dof} joints",
            ", ".join(fitting) or "a robot with more joints",
        )


def momentum_map(
    model: FreeFloatingModel, joints: npt.ArrayLike, attitude: npt.ArrayLike = _IDENTITY
) -> Array:
    """The centroidal momentum matrix.

    Args:
        model: Robot.
        joints: Joint values, shape (n,).
        attitude: Unit quaternion x, y, z, w; at the identity the rows are in spacecraft axes.

    Returns:
        Shape (6, 6 + n). Times ``[base twist; joint rates]`` it gives the linear momentum [N s] and
        the angular momentum about the centre of mass [N m s] in inertial axes.
    """
    q = np.concatenate([np.zeros(3), attitude, joints])
    return np.array(pin.computeCentroidalMap(model.pin_model, model.scratch, q))


def end_effector_jacobian(
    model: FreeFloatingModel, joints: npt.ArrayLike, attitude: npt.ArrayLike = _IDENTITY
) -> Array:
    """Jacobian of the end-effector, the base counted as a joint.

    Returns:
        Shape (6, 6 + n). Times ``[base twist; joint rates]`` it gives the end-effector's twist in
        inertial axes [m/s; rad/s]; at the identity attitude in spacecraft axes.
    """
    q = np.concatenate([np.zeros(3), attitude, joints])
    return np.array(
        pin.computeFrameJacobian(
            model.pin_model, model.scratch, q, model.frame_id, pin.LOCAL_WORLD_ALIGNED
        )
    )


def inertia_matrices(model: FreeFloatingModel, joints: npt.ArrayLike) -> tuple[Array, Array]:
    """D and Dq of (1): angular momentum per spacecraft rate and per joint rate.

    Both are about the system's centre of mass, in the spacecraft frame, the linear momentum being
    zero.

    Returns:
        ``D`` of shape (3, 3) and ``Dq`` of shape (3, n) [kg m²].
    """
    A = momentum_map(model, joints)
    return A[3:, 3:6], A[3:, 6:]


def system_matrix(model: FreeFloatingModel, joints: npt.ArrayLike, task: Task = Task.POSE) -> Array:
    """The matrix A of (5): what the momentum and the end-effector demand of the rates.

    Rows: angular momentum about the centre of mass, then the task's rows of the end-effector twist.
    Columns: spacecraft angular velocity, then joint rates. Everything in the spacecraft frame, the
    linear velocity of the spacecraft eliminated by zero linear momentum. For planar tasks only the
    components about z remain of the angular momentum and of the spacecraft's rate.

    Returns:
        Shape (3 + m, 3 + n), for planar tasks (1 + m, 1 + n).
    """
    A, J = _maps(model, joints)
    J = J[task.rows]
    J = J[:, 3:] - J[:, :3] @ (A[:3, 3:] / model.total_mass)
    D = A[3:, 3:]
    if task.planar:
        return np.vstack([D[2:], J])[:, 2:]
    return np.vstack([D, J])


def system_matrix_slope(
    model: FreeFloatingModel, joints: npt.ArrayLike, rates: npt.ArrayLike, task: Task = Task.POSE
) -> Array:
    """The derivative of :func:`system_matrix` while the joints move at rates (n,)."""
    robot, data = model.pin_model, model.scratch
    q, v = np.concatenate((_BASE, joints)), np.concatenate((np.zeros(6), rates))
    dJ = pin.frameJacobianTimeVariation(robot, data, q, v, model.frame_id, pin.LOCAL_WORLD_ALIGNED)[
        task.rows
    ]
    A, J = (np.array(matrix) for matrix in _maps(model, joints))
    dA = np.array(pin.computeCentroidalMapTimeVariation(robot, data, q, v))
    # Pinocchio's is about a fixed point: the centre of mass moves in the spacecraft frame
    dA[3:] -= pin.skew(A[:3] @ v / model.total_mass) @ A[:3]
    J = J[task.rows]
    dJ = dJ[:, 3:] - (dJ[:, :3] @ A[:3, 3:] + J[:, :3] @ dA[:3, 3:]) / model.total_mass
    if task.planar:
        return np.vstack([dA[5:, 3:], dJ])[:, 2:]
    return np.vstack([dA[3:, 3:], dJ])


def generalized_jacobian(
    model: FreeFloatingModel, joints: npt.ArrayLike, task: Task | str = Task.POSE
) -> Array:
    """The generalized Jacobian S* of (7), after Umetani and Yoshida (1989).

    Args:
        model: Robot.
        joints: Joint values, shape (n,).
        task: What of the end-effector is prescribed, or its value, such as ``"position"``.

    Returns:
        Shape (m, n): the task's rows of the end-effector twist [m/s; rad/s], in the spacecraft
        frame, per joint rate, while the momentum is zero.

    Raises:
        InputError: If there is no such task, or the joints are not those of the robot.
    """
    try:
        if task is not Task.POSE:
            task = Task.of(task)
            if task.planar:
                A = system_matrix(model, joints, task)
                return np.asarray(A[1:, 1:] - A[1:, :1] * (A[:1, 1:] / A[0, 0]))
        A, J = _maps(model, joints)
    except (TypeError, ValueError):  # joints are looked at when it is too late: that costs nothing
        _refuse_other_joints(model, joints)
        raise
    A = np.asfortranarray(A)  # solved in place
    _, _, base, singular = dgesv(A[:, :6], A[:, 6:], 1, 1)
    if singular:
        raise np.linalg.LinAlgError("the momentum does not determine the spacecraft's rates")
    S: Array = J[:, 6:] - J[:, :6].dot(base)
    return S if task is Task.POSE else S[task.rows]


def _refuse_other_joints(model: FreeFloatingModel, joints: npt.ArrayLike) -> None:
    if isinstance(joints, Mapping):
        told = type(joints).__name__
        raise InputError("joints", f"{told} was given", "model.joint_vector(...) of it")
    model.joint_vector(joints)  # which refuses what is no array


def generalized_determinant(
    model: FreeFloatingModel, joints: npt.ArrayLike, task: Task = Task.POSE
) -> float:
    """Det S* of (6), for arms with as many joints as task rows, without forming S*.

    The determinant of all the base and joint rates have to satisfy, over that of the momentum's
    share of it, which is the total mass cubed times det D.
    """
    A, J = _maps(model, joints)
    M = np.vstack([A, J[task.rows]])
    return determinant(M) / float(model.total_mass**3 * np.linalg.det(M[3:6, 3:6]))


def _maps(model: FreeFloatingModel, joints: npt.ArrayLike) -> tuple[Array, Array]:
    """The momentum map and the end-effector's Jacobian in spacecraft axes, found together."""
    q = np.concatenate((_BASE, joints))
    A = pin.computeCentroidalMap(model.pin_model, model.scratch, q)
    J = pin.getFrameJacobian(
        model.pin_model, model.scratch, model.frame_id, pin.LOCAL_WORLD_ALIGNED
    )
    return A, J


def determinant(M: Array) -> float:
    """As ``np.linalg.det``, in a third of the time."""
    LU, pivots, _ = dgetrf(M)
    swaps = sum(pivot != i for i, pivot in enumerate(pivots.tolist()))
    product = float(LU.diagonal().prod())
    return -product if swaps % 2 else product


class ResolvedRateSolver:
    """Equation (4): the rates that give the end-effector its twist and keep the momentum.

    With as many joints as task rows the solution is unique; with more, the joint rates are taken
    that :mod:`freefloat.dynamics.redundancy` describes.
    """

    def __init__(
        self,
        model: FreeFloatingModel,
        task: Task,
        momentum: npt.ArrayLike,
        redundancy: Redundancy | None = None,
    ) -> None:
        """Prepare the equation.

        Args:
            model: Robot.
            task: What of the end-effector is prescribed.
            momentum: Angular momentum about the centre of mass, inertial axes [N m s], shape (3,).
            redundancy: What a redundant arm does with its freedom; when left out, the joint rates
                of least Euclidean norm are taken [rad/s, m/s].

        Raises:
            InputError: If the task has more rows than the arm has joints, or the arm cannot do
                what is asked of its redundancy.
        """
        m, n = len(task.rows), model.dof
        refuse_too_few_joints(model, task)
        self._model = model
        self._rows = slice(None) if m == 6 else task.rows
        self._q = np.zeros(7 + n)
        self._matrix = np.zeros((6 + m, 6 + n), order="F")
        self._right = np.zeros(6 + m)
        self._right[3:6] = finite_vector("momentum", momentum, 3)
        self._free = None
        if redundancy is not None:
            free = NullSpaceMotion(model, task.rows, redundancy)
            self._free = None if redundancy.plain else free

    def rates(
        self, attitude: Array, joints: Array, twist: Array, speed: float = 0.0
    ) -> tuple[Array, Array]:
        """Solve (4) at a configuration.

        Args:
            attitude: Unit quaternion x, y, z, w.
            joints: Joint values, shape (n,).
            twist: End-effector twist, inertial axes, shape (6,).
            speed: Of the path, ds/dt [1/s], in proportion to which a redundant arm is drawn toward
                what it is asked to.

        Returns:
            Spacecraft angular velocity in the spacecraft frame [rad/s], shape (3,), and joint
            rates, shape (n,). Infinite where the matrix is exactly singular.
        """
        self._assemble(attitude, joints)
        matrix, right = self._matrix, self._right
        right[6:] = twist[self._rows]
        if matrix.shape[0] == matrix.shape[1]:
            _, _, v, singular = dgesv(matrix, right)
            if singular:
                v = np.full(len(v), np.inf)
            return v[3:6], v[6:]
        return self._one_of_many(speed)

    def _assemble(self, attitude: Array, joints: Array) -> None:
        model, q = self._model, self._q
        q[3:7], q[7:] = attitude, joints
        self._matrix[:6] = pin.computeCentroidalMap(model.pin_model, model.scratch, q)
        self._matrix[6:] = pin.getFrameJacobian(
            model.pin_model, model.scratch, model.frame_id, pin.LOCAL_WORLD_ALIGNED
        )[self._rows]

    def _one_of_many(self, speed: float) -> tuple[Array, Array]:
        Ab, Am = self._matrix[:6, :6], self._matrix[:6, 6:]
        Jb, Jm = self._matrix[6:, :6], self._matrix[6:, 6:]
        B = np.linalg.solve(Ab, np.column_stack([Am, self._right[:6]]))
        S = Jm - Jb @ B[:, :-1]
        Q, R = np.linalg.qr(S.T)
        through, singular = dtrtrs(R, self._right[6:] - Jb @ B[:, -1], trans=1)
        if singular:
            return np.full(3, np.inf), np.full(S.shape[1], np.inf)
        joint_rates = Q @ through
        if self._free is not None:
            joint_rates = joint_rates + self._free.addition(
                self._q, self._matrix, joint_rates, speed
            )
        base_twist = B[:, -1] - B[:, :-1] @ joint_rates
        return base_twist[3:], joint_rates
