"""The code that a user would write without freefloat: Pinocchio, numpy, scipy as they come."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

from freefloat.limits.pairs import CollisionPairs
from freefloat.motion.problem import Problem
from freefloat.robot.model import FreeFloatingModel


class PlainJacobian:
    """The generalized Jacobian by two of Pinocchio's functions and numpy's solve."""

    def __init__(self, model: FreeFloatingModel) -> None:
        self.model, self.frame = model.pin_model, model.frame_id
        self.data = self.model.createData()

    def __call__(self, joints: np.ndarray) -> np.ndarray:
        q = np.concatenate([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], joints])
        A = pin.computeCentroidalMap(self.model, self.data, q)
        J = pin.computeFrameJacobian(self.model, self.data, q, self.frame, pin.LOCAL_WORLD_ALIGNED)
        return J[:, 6:] - J[:, :6] @ np.linalg.solve(A[:, :6], A[:, 6:])


class PlainMotion:
    """Equation (4) solved with numpy and integrated by scipy's ``solve_ivp``."""

    def __init__(self, problem: Problem) -> None:
        self.model, self.frame = problem.model.pin_model, problem.model.frame_id
        self.data, self.rows = self.model.createData(), problem.task.rows
        self.momentum, self.path = problem.momentum, problem.path

    def matrix(self, y: np.ndarray) -> np.ndarray:
        q = np.concatenate([np.zeros(3), y[:4] / np.linalg.norm(y[:4]), y[4:]])
        A = pin.computeCentroidalMap(self.model, self.data, q)
        J = pin.computeFrameJacobian(self.model, self.data, q, self.frame, pin.LOCAL_WORLD_ALIGNED)
        return np.vstack([A, J[self.rows]])

    def rates(self, t: float, y: np.ndarray) -> np.ndarray:
        twist = self.path.twist(t)[self.rows]
        A, n = self.matrix(y), len(y) - 4
        demand = np.concatenate([np.zeros(3), self.momentum, twist])
        if A.shape[0] == A.shape[1]:
            v = np.linalg.solve(A, demand)
        else:
            S, X = self.reduced(A)
            joints = np.linalg.pinv(S) @ (twist - A[6:, :6] @ X[:, n:] @ demand[:6])
            v = np.append(X[:, n:] @ demand[:6] - X[:, :n] @ joints, joints)
        x, w = y[:3], y[3]
        omega = v[3:6]
        quaternion = 0.5 * np.append(w * omega + np.cross(x, omega), -x @ omega)
        return np.concatenate([quaternion, v[6:]])

    def reduced(self, A: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Generalized Jacobian, and base twist per joint rate and per momentum."""
        X = np.linalg.solve(A[:6, :6], np.hstack([A[:6, 6:], np.eye(6)]))
        return A[6:, 6:] - A[6:, :6] @ X[:, :-6], X

    def final(self, attitude: np.ndarray, joints: np.ndarray, tolerance: float) -> np.ndarray:
        """The last state of one motion, by scipy's best method for smooth problems."""
        start = np.concatenate([attitude, joints])
        span = (0.0, self.path.duration)
        solution = solve_ivp(
            self.rates, span, start, method="DOP853", rtol=tolerance, atol=tolerance
        )
        return solution.y[:, -1]

    def minimum(self, attitude: np.ndarray, joints: np.ndarray, tolerance: float = 1e-6) -> float:
        """The minimum magnitude of the determinant over a motion, which a sweep needs.

        By ``solve_ivp``'s default method, which an event stops where the determinant vanishes; the
        minimum is that at the solver's own steps.
        """

        def singular(t: float, y: np.ndarray) -> float:
            A = self.matrix(y)
            if A.shape[0] == A.shape[1]:
                return float(np.linalg.det(A))
            S, _ = self.reduced(A)
            return float(np.sqrt(np.linalg.det(S @ S.T)))

        singular.terminal = True
        solution = solve_ivp(
            self.rates, (0.0, self.path.duration), np.concatenate([attitude, joints]),
            rtol=tolerance, atol=tolerance, events=singular,
        )  # fmt: skip
        return min(abs(singular(0.0, y)) for y in solution.y.T)

    def worst(
        self,
        attitude: np.ndarray,
        joints: np.ndarray,
        body: int,
        *,
        torques: bool = False,
        pairs: CollisionPairs | None = None,
    ) -> np.ndarray:
        """What limits need: smallest determinant, largest rates of joints and base, turn, pointing.

        At 200 instants of one motion, as ``solve_ivp`` interpolates it; a body's angle from its
        start stands for pointing. Then, if asked for, the largest torques and the smallest distance
        of pairs of meshes at these instants.
        """
        times = np.linspace(0.0, self.path.duration, 200)
        solution = solve_ivp(
            self.rates, times[[0, -1]], np.concatenate([attitude, joints]), rtol=1e-6, atol=1e-6,
            t_eval=times,
        )  # fmt: skip
        rows = []
        for t, y in zip(solution.t, solution.y.T, strict=True):
            rates, determinant = self.rates(t, y), np.linalg.det(self.matrix(y))
            axis = self.data.oMi[body].rotation[:, 2]
            turn = abs(y[:4] @ attitude) / np.linalg.norm(y[:4])
            base = 2.0 * np.linalg.norm(rates[:4])
            rows.append([-abs(determinant), *np.abs(rates[4:]), base, -turn, -axis[2]])
        results = [np.max(rows, axis=0)]
        if torques:
            results.append(np.max(np.abs(self.torques(solution.t, solution.y.T)), axis=0))
        if pairs is not None:
            every = np.arange(len(pairs.pairs))
            near = [pairs.distances(y[4:], every).min() for y in solution.y.T]
            results.append(np.min(near, keepdims=True))
        return np.concatenate(results)

    def torques(self, times: np.ndarray, states: np.ndarray) -> np.ndarray:
        """Joint torques at instants, by inverse dynamics of differentiated velocities."""
        configurations = [np.concatenate([np.zeros(3), y]) for y in states]
        slopes = np.gradient(states, times, axis=0)
        velocities = []
        for q, slope in zip(configurations, slopes, strict=True):
            A = pin.computeCentroidalMap(self.model, self.data, q)
            x, w, dx, dw = q[3:6], q[6], slope[:3], slope[3]
            turn = 2.0 * (w * dx - dw * x - np.cross(x, dx))
            angular = np.append(turn, slope[4:])
            velocities.append(np.append(-np.linalg.solve(A[:3, :3], A[:3, 3:] @ angular), angular))
        accelerations = np.gradient(velocities, times, axis=0)
        motion = zip(configurations, velocities, accelerations, strict=True)
        return np.array([pin.rnea(self.model, self.data, *state)[6:] for state in motion])
