"""What a redundant arm adds to the rates of least Euclidean norm, see ``redundancy``.

Everything added lies in the null space of the generalized Jacobian to the last digit, so that it
moves neither the end-effector nor the momentum.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from freefloat.dynamics.redundancy import Metric, Redundancy, Toward
from freefloat.errors import InputError, did_you_mean
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array


def refuse_unfit(model: FreeFloatingModel, rows: int, redundancy: Redundancy) -> None:
    """Raise an InputError if an arm cannot do what is asked of its redundancy.

    Args:
        model: Robot.
        rows: How many rates the task prescribes.
        redundancy: What is asked.
    """
    if model.dof <= rows:
        raise InputError(
            "redundancy",
            f"the task prescribes {rows} rates and the arm has {model.dof} joints: none to spare",
            "no such key, or a task that prescribes less",
        )
    for joint in redundancy.weights:
        if joint not in model.joint_names:
            raise InputError(
                f"redundancy.metric.{joint}",
                f"there is no such moving joint{did_you_mean(joint, model.joint_names)}",
                ", ".join(model.joint_names),
            )
    if redundancy.toward is Toward.MIDDLE and not np.isfinite(middles(model)).any():
        raise InputError(
            "redundancy.toward", "middle, but no joint of this arm has a range", "none or sigma"
        )


def middles(model: FreeFloatingModel) -> Array:
    """Of the joint ranges [rad, m], nan for joints without one, shape (n,)."""
    ranges = np.array([(body.lower, body.upper) for body in model.bodies[1:]])
    finite = np.isfinite(ranges).all(axis=1)
    return np.where(finite, np.where(finite[:, None], ranges, 0.0).mean(axis=1), np.nan)


def weights(model: FreeFloatingModel, redundancy: Redundancy) -> Array:
    """Of the squared joint rates, in units of their mean, shape (n,)."""
    given = np.array([redundancy.weights.get(joint, 1.0) for joint in model.joint_names])
    return np.asarray(given / given.mean())


class NullSpaceMotion:
    """The part of a redundant arm's joint rates that the path leaves free."""

    def __init__(self, model: FreeFloatingModel, rows: list[int], redundancy: Redundancy) -> None:
        """Prepare.

        Args:
            model: Robot.
            rows: Of the end-effector's twist that the task prescribes.
            redundancy: What to do with the freedom.

        Raises:
            InputError: If the arm cannot do that.
        """
        refuse_unfit(model, len(rows), redundancy)
        self._model, self._rows, self._redundancy = model, rows, redundancy
        self._weights = np.diag(weights(model, redundancy))
        self._middles = middles(model)

    def addition(self, q: Array, matrix: Array, rates: Array, speed: float) -> Array:
        """What to add to joint rates.

        Args:
            q: Configuration as Pinocchio has it, shape (7 + n,).
            matrix: Of (4), momentum before end-effector, shape (6 + m, 6 + n).
            rates: Joint rates that solve (4), shape (n,).
            speed: Of the path, ds/dt [1/s].

        Returns:
            Shape (n,); infinite where S* is singular.
        """
        base = np.asarray(np.linalg.solve(matrix[:6, :6], matrix[:6, 6:]), dtype=float)
        S = matrix[6:, 6:] - matrix[6:, :6] @ base
        basis = np.linalg.qr(S.T, mode="complete")[0][:, len(S) :]
        W = self._metric(q, base)
        inner = basis.T @ W @ basis
        try:
            added = -basis @ np.linalg.solve(inner, basis.T @ (W @ rates))
            if self._redundancy.toward is not Toward.NONE and speed != 0.0:
                gradient = self._gradient(q, matrix, base, S)
                pull = basis @ np.linalg.solve(inner, basis.T @ gradient)
                pull *= self._redundancy.gain
                share = np.linalg.norm(pull) / self._redundancy.bound
                added += speed / np.hypot(1.0, share) * pull
        except np.linalg.LinAlgError:
            return np.full(len(rates), np.inf)
        return np.asarray(added)

    def _metric(self, q: Array, base: Array) -> Array:
        """W, in units of its mean diagonal element, shape (n, n)."""
        if self._redundancy.metric is not Metric.ENERGY:
            return self._weights
        upper = np.triu(pin.crba(self._model.pin_model, self._model.scratch, q))
        H = upper + np.triu(upper, 1).T
        W = H[6:, 6:] - H[6:, :6] @ base
        return np.asarray(W / W.diagonal().mean())

    def _gradient(self, q: Array, matrix: Array, base: Array, S: Array) -> Array:
        """Of what the arm is drawn toward, by the joints, shape (n,)."""
        if self._redundancy.toward is Toward.MIDDLE:
            return np.nan_to_num(self._middles - q[7:])
        return self._manipulability_gradient(q, matrix, base, S)

    def _manipulability_gradient(self, q: Array, matrix: Array, base: Array, S: Array) -> Array:
        """Of ln sqrt(det(S* S*^T)): the trace of S*'s change times S*'s pseudoinverse.

        A column of the pseudoinverse is a motion of the whole robot without momentum that moves the
        end-effector along one row alone; how S* changes along it follows from how momentum and
        twist of that motion do, the base taking up the momentum. Pinocchio's derivative of the
        twist is that at a point fixed in space; the end-effector's adds how that point moves.
        """
        model, data, frame = self._model.pin_model, self._model.scratch, self._model.frame_id
        columns = np.linalg.pinv(S)
        motions = np.vstack([-base @ columns, columns])
        taken_up = np.linalg.solve(matrix[:6, :6].T, matrix[6:, :6].T).T
        J = np.array(pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED))
        gradient, still = np.zeros(len(columns)), np.zeros(len(motions))
        for i, row in enumerate(self._rows):
            momentum = pin.computeCentroidalDynamicsDerivatives(
                model, data, q, np.ascontiguousarray(motions[:, i]), still
            )[0]
            twist = pin.getFrameVelocityDerivatives(model, data, frame, pin.LOCAL_WORLD_ALIGNED)[0]
            gradient += twist[row, 6:] - taken_up[i] @ momentum[:, 6:]
            if row < 3:
                gradient += np.cross(J[3:] @ motions[:, i], J[:3, 6:].T)[:, row]
        return gradient
