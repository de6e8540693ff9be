"""Equation (4): the rates that give the end-effector its twist and conserve the momentum."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy.linalg.lapack import dgesv, dtrtrs

from freefloat.dynamics.momentum import Task, require_enough_joints
from freefloat.dynamics.null_space import NullSpaceMotion
from freefloat.dynamics.redundancy import Redundancy
from freefloat.errors import finite_vector
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array


class ResolvedRateSolver:
    """Solves equation (4) for the spacecraft's angular velocity and the joint rates.

        [ centroidal momentum matrix ]        [ 0   ]
        [ end-effector Jacobian rows ]  v  =  [ h   ]
                                              [ v_E ]

    With as many joints as task rows the solution is unique; a redundant arm takes the rates
    described in :mod:`freefloat.dynamics.null_space`.
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
            task: Part of the end-effector's motion that is prescribed.
            momentum: Angular momentum about the centre of mass, inertial frame [N m s], shape (3,).
            redundancy: Null-space motion of a redundant arm; minimum-norm rates when left out.

        Raises:
            InputError: If the task has more rows than the arm has joints, or the redundancy does
                not apply to the arm.
        """
        m, n = len(task.rows), model.dof
        require_enough_joints(model, task)
        self._model = model
        self._rows = slice(None) if m == 6 else task.rows
        self._q = np.zeros(7 + n)
        self._A = np.zeros((6 + m, 6 + n), order="F")
        self._b = np.zeros(6 + m)
        self._b[3:6] = finite_vector("momentum", momentum, 3)
        self._null_space = None
        if redundancy is not None:
            null_space = NullSpaceMotion(model, task.rows, redundancy)
            self._null_space = None if redundancy.minimum_norm else null_space

    def rates(
        self, attitude: Array, joints: Array, twist: Array, speed: float = 0.0
    ) -> tuple[Array, Array]:
        """Solve (4) at a configuration.

        Args:
            attitude: Unit quaternion x, y, z, w.
            joints: Joint values, shape (n,).
            twist: End-effector twist, inertial frame, shape (6,).
            speed: Path speed ds/dt [1/s], which scales the attraction of a redundant arm.

        Returns:
            Spacecraft angular velocity in the spacecraft frame [rad/s], shape (3,), and joint
            rates, shape (n,). Infinite where the matrix is exactly singular.
        """
        model, q, A, b = self._model, self._q, self._A, self._b
        q[3:7], q[7:] = attitude, joints
        A[:6] = pin.computeCentroidalMap(model.pin_model, model.scratch, q)
        A[6:] = pin.getFrameJacobian(
            model.pin_model, model.scratch, model.frame_id, pin.LOCAL_WORLD_ALIGNED
        )[self._rows]
        b[6:] = twist[self._rows]
        if A.shape[0] == A.shape[1]:
            _, _, v, singular = dgesv(A, b)
            if singular:
                v = np.full(len(v), np.inf)
            return v[3:6], v[6:]
        return self._redundant_rates(speed)

    def _redundant_rates(self, speed: float) -> tuple[Array, Array]:
        Ab, Am = self._A[:6, :6], self._A[:6, 6:]
        Jb, Jm = self._A[6:, :6], self._A[6:, 6:]
        B = np.linalg.solve(Ab, np.column_stack([Am, self._b[:6]]))
        S = Jm - Jb @ B[:, :-1]
        Q, R = np.linalg.qr(S.T)
        coordinates, singular = dtrtrs(R, self._b[6:] - Jb @ B[:, -1], trans=1)
        if singular:
            return np.full(3, np.inf), np.full(S.shape[1], np.inf)
        u = Q @ coordinates
        if self._null_space is not None:
            u = u + self._null_space.rates(self._q, self._A, u, speed)
        base_twist = B[:, -1] - B[:, :-1] @ u
        return base_twist[3:], u
