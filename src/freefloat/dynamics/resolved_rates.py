"""Equation (4): the rates that give the end-effector its twist and conserve the momentum.

    M v = b:    [ A_G ]        [ 0   ]
                [  J  ]  v  =  [ h   ]
                               [ v_E ]

with the centroidal momentum matrix A_G and the task's rows of the end-effector Jacobian J. Where
several arms follow paths, J and v_E are stacked arm after arm. With as
many joints as task rows the solution is unique. The joint rates of a redundant arm differ by
motions in the null space of the generalized Jacobian S*, which neither move the end-effector nor
change the momentum. Among them the rates ``u`` are taken that minimize

    u^T W u / 2 - c ds/dt (u . g),  c = gain / sqrt(1 + (|a| / bound)^2)

where W is the metric divided by its mean diagonal element, g the gradient of the objective, and a
the null-space motion per unit of s that c = gain would give, the unsaturated attraction. Without an
objective these are the rates of minimum norm. With one, a null-space motion along which the
objective does not decrease is added, projected in the same metric.

The attraction is proportional to the path speed ds/dt, so it vanishes where the path stops, and
without momentum joints and attitude depend on the path parameter alone: a longer duration gives the
same motion. The gain is therefore dimensionless: one over the fraction of the path in which an
attraction of unit gradient takes effect. A motion integrated backward retraces the forward one,
because ds/dt changes sign with the end-effector's velocity.

Toward the manipulability g is the gradient of its logarithm, ln sqrt(det(S* S*^T)): that grows with
the smallest singular value but is smooth where two singular values coincide, and, where all
joints are revolute, does not depend on the unit of length. Toward ``middle`` g is the difference
from the joints to the centres of their ranges; joints without a range do not count.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from scipy.linalg.lapack import dgeqrf, dgesv, dorgqr, dtrtrs

from freefloat.dynamics.momentum import CARRIED, mass_matrix
from freefloat.dynamics.redundancy import Metric, Redundancy, Toward, joint_weights, range_centres
from freefloat.dynamics.system import System
from freefloat.dynamics.tasks import Task, prescribed_rows, require_task, required_plane
from freefloat.so3 import Array, turned


class ResolvedRateSolver:
    """Solver of equation (4) for the spacecraft's angular velocity and the joint rates."""

    def __init__(
        self, system: System, task: Task | str, redundancy: Redundancy | None = None
    ) -> None:
        """Prepare the equation, with a row for the rate of each joint of further arms that move.

        Args:
            system: Robot, momentum and wheels.
            task: Task or its value, such as ``"position"``.
            redundancy: Null-space motion of a redundant arm; minimum-norm rates when left out.

        Raises:
            InputError: If the robot cannot have the task, or the redundancy does not apply to it.
        """
        model = system.model
        task = require_task(model, task)
        self._rows = prescribed_rows(model, task)
        m, n, k = len(self._rows), model.dof, model.dof - model.arm_dof
        if redundancy is not None:
            redundancy.require_applicable(model, task)
        self._model = model
        self._plane = required_plane(model, task) if task.planar else None
        self._robot, self._data = model.pin_model, model.pin_model.createData()
        self._further = bool(model.arms)
        count = len(task.rows)
        self._selected = slice(count) if task.rows == [*range(count)] else task.rows
        self._parts = [
            (frame, slice(6 + first, 6 + first + len(task.rows)))
            for frame, first in zip(model.frame_ids, range(0, m, len(task.rows)), strict=True)
        ]
        self._frame, self._own_axes = task.reference_frame, task is Task.POINTING
        self._q = np.zeros(7 + n)
        self._M = np.zeros((6 + m + k, 6 + n), order="F")
        self._M[6 + m :, 6 + model.arm_dof :] = np.eye(k)
        self._task = slice(6, 6 + m)
        self._b = np.zeros(6 + m + k)
        self._B = np.zeros((6, n + 1), order="F")
        self._b[3:6] = system.momentum
        first = 2 if model.on_table else 0  # of the axes about which momentum is conserved
        self._axes, self._conserved = slice(first, 3), slice(3 + first, 6)
        self._on_table, self._still = model.on_table, np.eye(6, 6 + n)[CARRIED]
        self._system, self._wheels = system, bool(system.wheels.any())
        self._redundancy = redundancy or Redundancy()
        self._weights = np.diag(joint_weights(model, self._redundancy))
        self._centres = range_centres(model)

    def rates(
        self,
        attitude: Array,
        joints: Array,
        twist: Array,
        speed: float | Array = 0.0,
        arm_rates: Array | None = None,
    ) -> tuple[Array, Array]:
        """Solve (4) at a configuration, or at K of them.

        Args:
            attitude: Unit quaternion x, y, z, w, shape (4,) or (K, 4).
            joints: Joint values, shape (n,) or (K, n).
            twist: End-effector twist, inertial frame, shape (6,) or (K, 6); of several arms that
                follow paths one after the other.
            speed: Path speed ds/dt [1/s], which scales the attraction of a redundant arm.
            arm_rates: Joint rates of further arms that move, shape (..., dof - arm_dof).

        Returns:
            Spacecraft angular velocity in the spacecraft frame [rad/s], shape (..., 3), and joint
            rates, shape (..., n). Infinite where the matrix is exactly singular.
        """
        if joints.ndim == 2:
            return self._many_rates(attitude, joints, twist, speed, arm_rates)
        M, b = self._M, self._b
        self._demand(b, attitude, twist, arm_rates, self._fill(M, attitude, joints))
        if M.shape[0] == M.shape[1]:
            _, _, v, singular = dgesv(M, b)
            return (v[3:6], v[6:]) if not singular else self._infinite()
        try:
            return self._redundant_rates(float(speed))
        except np.linalg.LinAlgError:
            return self._infinite()

    def _many_rates(
        self, attitudes: Array, joints: Array, twists: Array, speeds: float | Array,
        arm_rates: Array | None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """The rates at K configurations, all solved at once where they have a closed form."""
        square, K = self._M.shape[0] == self._M.shape[1], len(joints)
        if K and (square or self._redundancy.minimum_norm):
            try:
                M, b = np.tile(self._M, (K, 1, 1)), np.tile(self._b, (K, 1))
                axes = [self._fill(*state) for state in zip(M, attitudes, joints, strict=True)]
                by_arm = [np.array(arm) for arm in zip(*axes, strict=True)]
                self._demand(b, attitudes, twists, arm_rates, by_arm)
                return _solutions(M, b) if square else _shortest_solutions(M, b)
            except np.linalg.LinAlgError:  # singular somewhere
                pass
        speeds = np.broadcast_to(speeds, K)
        further = [None] * K if arm_rates is None else arm_rates
        states = zip(attitudes, joints, twists, speeds.tolist(), further, strict=True)
        solved = [np.concatenate(self.rates(*state)) for state in states]
        rates = np.array(solved).reshape(K, 3 + joints.shape[1])
        return rates[:, :3], rates[:, 3:]

    def _demand(
        self, b: Array, attitude: Array, twist: Array, arm_rates: Array | None, axes: list[Array]
    ) -> None:
        """Write the right-hand side of (4), or K of them; ``axes`` has each end-effector's axes."""
        for arm, (_, rows) in enumerate(self._parts):
            part = twist[..., 6 * arm : 6 * arm + 6]
            if self._own_axes:
                part = (part.reshape(*part.shape[:-1], 2, 3) @ axes[arm]).reshape(part.shape)
            b[..., rows] = self._prescribed(part.T).T
        if self._further:
            if arm_rates is None:
                self._model.require_supported("these joint rates")
            b[..., self._task.stop :] = arm_rates
        if self._wheels:
            b[..., self._conserved] = self._system.body_momentum(attitude)[..., self._axes]

    def _fill(self, M: Array, attitude: Array, joints: Array) -> list[Array]:
        """Write the matrix of (4) at a configuration; axes of end-effectors in which rows are."""
        robot, data, q, axes = self._robot, self._data, self._q, []
        q[3:7], q[7:] = attitude, joints
        M[:6] = pin.computeCentroidalMap(robot, data, q)
        if self._on_table:
            M[CARRIED] = self._still
        for frame, rows in self._parts:
            M[rows] = self._prescribed(pin.getFrameJacobian(robot, data, frame, self._frame))
            if self._own_axes:
                axes.append(pin.updateFramePlacement(robot, data, frame).rotation.copy())
        return axes

    def _prescribed(self, twists: Array) -> Array:
        """The task's rows of twists of an end-effector (6, ...)."""
        if self._plane is not None:
            twists = self._plane.rows(twists)
        return twists[self._selected]

    def _infinite(self) -> tuple[Array, Array]:
        return np.full(3, np.inf), np.full(self._model.dof, np.inf)

    def _redundant_rates(self, speed: float) -> tuple[Array, Array]:
        A_G, J, B = self._M[:6], self._M[6:], self._B
        B[:, :-1], B[:, -1] = A_G[:, 6:], self._b[:6]
        _, _, solution, failed = dgesv(A_G[:, :6], B)
        base: Array = solution[:, :-1]
        momentum_twist = solution[:, -1]
        S: Array = J[:, 6:] - J[:, :6] @ base
        m, n = S.shape
        R, reflections, _, _ = dgeqrf(S.T)
        coordinates, singular = dtrtrs(R[:m], self._b[6:] - J[:, :6] @ momentum_twist, trans=1)
        if failed or singular:
            return self._infinite()
        Q = np.zeros((n, n), order="F")
        Q[:, :m] = R
        Q, _, _ = dorgqr(Q, reflections, overwrite_a=True)
        u = Q[:, :m] @ coordinates
        if not self._redundancy.minimum_norm:
            N = Q[:, m:]
            W = self._metric(base)
            P = np.linalg.solve(N.T @ W @ N, N.T)
            z = -P @ (W @ u)
            if self._redundancy.toward is not Toward.NONE and speed != 0.0:
                z += speed * self._attraction(base, S, P)
            u = u + N @ z
        return (momentum_twist - base @ u)[3:], u

    def _attraction(self, base: Array, S: Array, P: Array) -> Array:
        """Components of the saturated attraction per unit of s; P maps g to components."""
        if self._redundancy.toward is Toward.MIDDLE:
            g = np.nan_to_num(self._centres - self._q[7:])
        else:
            g = self._manipulability_gradient(base, S)
        attraction = self._redundancy.gain * (P @ g)
        ratio = np.linalg.norm(attraction) / self._redundancy.bound
        return np.asarray(attraction / np.hypot(1.0, ratio))

    def _metric(self, base: Array) -> Array:
        """W divided by its mean diagonal element, shape (n, n)."""
        if self._redundancy.metric is not Metric.ENERGY:
            return self._weights
        H = mass_matrix(self._model, self._q[7:])  # with the armature, which ensembles leave out
        W = H[6:, 6:] - H[6:, :6] @ base - np.diag(self._robot.armature[6:])
        return np.asarray(W / W.diagonal().mean())

    def _manipulability_gradient(self, base: Array, S: Array) -> Array:
        """Gradient of ln sqrt(det(S* S*^T)): trace of the pseudoinverse times dS*, shape (n,).

        A column of the pseudoinverse is a momentum-free motion of the whole robot that moves the
        end-effector along one row alone. The change of S* along it follows from the derivatives of
        momentum and twist, with the base conserving the momentum. Pinocchio differentiates the
        twist at a point fixed in space; the motion of that point with the end-effector is added,
        unless the twist is in the axes of the end-effector.
        """
        robot, data, q, M = self._robot, self._data, self._q, self._M
        frames, axes = self._model.frame_ids, self._frame
        columns = np.linalg.pinv(S)
        motions = np.vstack([-base @ columns, columns])
        recoil = np.linalg.solve(M[:6, :6].T, M[6:, :6].T).T
        Js = [np.array(pin.computeFrameJacobian(robot, data, q, frame, axes)) for frame in frames]
        gradient = np.zeros(len(columns))
        no_acceleration = np.zeros(len(motions))
        for i, (arm, row) in enumerate(divmod(row, 6) for row in self._rows):
            J, frame = Js[arm], frames[arm]
            momentum = pin.computeCentroidalDynamicsDerivatives(
                robot, data, q, np.ascontiguousarray(motions[:, i]), no_acceleration
            )[0]
            if self._on_table:
                momentum = np.array(momentum)
                momentum[CARRIED] = 0.0
            twist = np.array(pin.getFrameVelocityDerivatives(robot, data, frame, axes)[0][:, 6:])
            if not self._own_axes:
                twist[:3] += np.cross(J[3:] @ motions[:, i], J[:3, 6:].T).T
            if self._plane is not None:
                twist = self._plane.rows(twist)
            gradient += twist[row] - recoil[i] @ momentum[:, 6:]
        return gradient


def _solutions(M: Array, b: Array) -> tuple[Array, Array]:
    """Angular velocities and joint rates that solve square equations (K, r, r)."""
    v = np.asarray(np.linalg.solve(M, b[..., None])[..., 0], dtype=float)
    return v[:, 3:6], v[:, 6:]


def _shortest_solutions(M: Array, b: Array) -> tuple[Array, Array]:
    """Angular velocities, and joint rates of minimum norm, that solve equations (K, r, 6 + n)."""
    B = np.concatenate([M[:, :6, 6:], b[:, :6, None]], axis=2)
    solution = np.linalg.solve(M[:, :6, :6], B)
    reduced = np.concatenate([M[:, 6:, 6:], b[:, 6:, None]], axis=2) - M[:, 6:, :6] @ solution
    Q, R = np.linalg.qr(reduced[..., :-1].swapaxes(1, 2))
    u = turned(Q, np.linalg.solve(R.swapaxes(1, 2), reduced[..., -1:])[..., 0])
    return np.asarray(solution[:, 3:, -1] - turned(solution[:, 3:, :-1], u)), u
