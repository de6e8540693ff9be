"""Null-space motion of a redundant arm, added to the joint rates of minimum Euclidean norm.

A redundant arm can follow a path with infinitely many joint rates. They differ by motions in the
null space of the generalized Jacobian S*, which move neither the end-effector nor change the
momentum. Among them the rates ``u`` are taken that minimize

    u^T W u / 2 - gain ds/dt (u . g)

where W is the metric, divided by its mean diagonal element, and g the gradient of the objective.
Without objective these are the rates of minimum norm. With it the arm adds a null-space motion,
projected in the same metric, along which the objective does not decrease.

The attraction is proportional to the path speed ds/dt, so it vanishes where the path stops, and
without momentum joints and attitude depend on the path parameter alone: a longer duration gives the
same motion. The gain is therefore dimensionless: one over the fraction of the path in which an
attraction of unit gradient takes effect. A motion integrated backward retraces the forward one,
with or without momentum, because ds/dt changes sign with the end-effector's velocity. The reversed
path is another path, on which the arm ascends the gradient again.

Toward ``sigma`` g is the gradient of ln sqrt(det(S* S*^T)), the logarithm of the manipulability: it
grows with the smallest singular value but is smooth where two singular values coincide, and it does
not depend on the unit of length. Toward ``middle`` g is the difference from the joints to the
centres of their ranges; joints without a range do not count.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from freefloat.dynamics.redundancy import (
    Metric,
    Redundancy,
    Toward,
    check_redundancy,
    joint_weights,
    range_centres,
)
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array


class NullSpaceMotion:
    """Joint rates in the null space of S* that minimize the objective above."""

    def __init__(self, model: FreeFloatingModel, rows: list[int], redundancy: Redundancy) -> None:
        """Prepare the metric and the objective.

        Args:
            model: Robot.
            rows: Rows of the end-effector twist that the task prescribes.
            redundancy: Settings.

        Raises:
            InputError: If the settings do not apply to the arm.
        """
        check_redundancy(model, len(rows), redundancy)
        self._model, self._rows, self._redundancy = model, rows, redundancy
        self._weights = np.diag(joint_weights(model, redundancy))
        self._centres = range_centres(model)

    def rates(self, q: Array, A: Array, u: Array, speed: float) -> Array:
        """Null-space rates to add to joint rates ``u``.

        Args:
            q: Pinocchio's configuration vector, shape (7 + n,).
            A: Matrix of (4), momentum rows before end-effector rows, shape (6 + m, 6 + n).
            u: Joint rates that solve (4), shape (n,).
            speed: Path speed ds/dt [1/s].

        Returns:
            Shape (n,); infinite where S* is singular.
        """
        base = np.asarray(np.linalg.solve(A[:6, :6], A[:6, 6:]), dtype=float)
        S = A[6:, 6:] - A[6:, :6] @ base
        N = np.linalg.qr(S.T, mode="complete")[0][:, len(S) :]
        W = self._metric(q, base)
        H = N.T @ W @ N
        try:
            z = -N @ np.linalg.solve(H, N.T @ (W @ u))
            if self._redundancy.toward is not Toward.NONE and speed != 0.0:
                g = self._gradient(q, A, base, S)
                attraction = N @ np.linalg.solve(H, N.T @ g)
                attraction *= self._redundancy.gain
                ratio = np.linalg.norm(attraction) / self._redundancy.bound
                z += speed / np.hypot(1.0, ratio) * attraction
        except np.linalg.LinAlgError:
            return np.full(len(u), np.inf)
        return np.asarray(z)

    def _metric(self, q: Array, base: Array) -> Array:
        """W divided by its mean diagonal element, shape (n, n)."""
        if self._redundancy.metric is not Metric.ENERGY:
            return self._weights
        upper = np.triu(pin.crba(self._model.pin_model, self._model.scratch, q))
        H = upper + np.triu(upper, 1).T
        W = H[6:, 6:] - H[6:, :6] @ base
        return np.asarray(W / W.diagonal().mean())

    def _gradient(self, q: Array, A: Array, base: Array, S: Array) -> Array:
        """Gradient g of the objective with respect to the joints, shape (n,)."""
        if self._redundancy.toward is Toward.MIDDLE:
            return np.nan_to_num(self._centres - q[7:])
        return self._manipulability_gradient(q, A, base, S)

    def _manipulability_gradient(self, q: Array, A: Array, base: Array, S: Array) -> Array:
        """Gradient of ln sqrt(det(S* S*^T)): trace of the pseudoinverse times dS*, shape (n,).

        A column of the pseudoinverse is a momentum-free motion of the whole robot that moves the
        end-effector along one row alone. The change of S* along it follows from the derivatives of
        momentum and twist, with the base conserving the momentum. Pinocchio differentiates the
        twist at a point fixed in space; the motion of that point with the end-effector is added.
        """
        model, data, frame = self._model.pin_model, self._model.scratch, self._model.frame_id
        columns = np.linalg.pinv(S)
        motions = np.vstack([-base @ columns, columns])
        recoil = np.linalg.solve(A[:6, :6].T, A[6:, :6].T).T
        J = np.array(pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED))
        gradient, no_acceleration = np.zeros(len(columns)), np.zeros(len(motions))
        for i, row in enumerate(self._rows):
            momentum = pin.computeCentroidalDynamicsDerivatives(
                model, data, q, np.ascontiguousarray(motions[:, i]), no_acceleration
            )[0]
            twist = pin.getFrameVelocityDerivatives(model, data, frame, pin.LOCAL_WORLD_ALIGNED)[0]
            gradient += twist[row, 6:] - recoil[i] @ momentum[:, 6:]
            if row < 3:
                gradient += np.cross(J[3:] @ motions[:, i], J[:3, 6:].T)[:, row]
        return gradient
