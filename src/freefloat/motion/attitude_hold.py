"""What wheels would have to do to hold the spacecraft's attitude along the same path.

With the attitude held, linear momentum and the path alone determine the rates, and the wheels take
whatever angular momentum the system of spacecraft and arm does not have: h_w = R0^T (h - A_G v),
which is -Dq q' where the wheels are at rest without it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from freefloat.dynamics.momentum import end_effector_jacobian, momentum_map
from freefloat.dynamics.tasks import Task, task_rows
from freefloat.errors import UnreachableError
from freefloat.ik.branches import ArmBranch
from freefloat.motion.integration import integrate_motion
from freefloat.motion.problem import Problem, require_problem
from freefloat.so3 import Array, angle_between, frozen, rotation_matrix

_TOLERANCE = 1e-9
_INSTANTS = 401
"""Instants in each span of the time law at which momenta are computed."""
_SINGULAR = 1e-4
"""Ratio of the singular values of the Jacobian at which the arm counts as singular."""


@dataclass(frozen=True, eq=False)
class HeldAttitude:
    """Wheel momenta and torques that hold an attitude along a path.

    Vectors are in the spacecraft frame.

    Attributes:
        attitude: Attitude that is held, quaternion x, y, z, w.
        branch: The arm at the start.
        completed: Whether the arm follows the whole path; else it becomes singular.
        times: Times [s], shape (K,).
        joints: Joint values [rad or m], shape (K, n).
        momenta: Angular momenta stored in the wheels [N m s], shape (K, 3).
        torques: Their rates, the torques on the wheels [N m], shape (K, 3).
        drift_turn: Largest angle from the attitude at the start when the spacecraft drifts from it
            along the same path [rad]; None where that motion does not complete.
    """

    attitude: Array
    branch: ArmBranch
    completed: bool
    times: Array = field(repr=False)
    joints: Array = field(repr=False)
    momenta: Array = field(repr=False)
    torques: Array = field(repr=False)
    drift_turn: float | None

    def __post_init__(self) -> None:
        object.__setattr__(self, "attitude", frozen(self.attitude))

    @property
    def largest_momentum(self) -> float:
        """Largest magnitude of the wheel momentum [N m s]."""
        return float(np.linalg.norm(self.momenta, axis=1).max())

    @property
    def largest_torque(self) -> float:
        """Largest magnitude of the torque [N m]."""
        return float(np.linalg.norm(self.torques, axis=1).max())

    def to_dict(self) -> dict[str, Any]:
        """The JSON document: magnitudes, by axis and in all."""
        turn = self.drift_turn
        return {
            "attitude": self.attitude.tolist(),
            "branch": self.branch.index,
            "joints": self.branch.joints.tolist(),
            "completed": self.completed,
            "ended_at": float(self.times[-1]),
            "wheel_momentum": np.abs(self.momenta).max(axis=0).tolist(),
            "wheel_momentum_norm": self.largest_momentum,
            "wheel_torque": np.abs(self.torques).max(axis=0).tolist(),
            "wheel_torque_norm": self.largest_torque,
            "drift_turn_deg": None if turn is None else float(np.degrees(turn)),
        }


def hold_attitude(problem: Problem, attitude: npt.ArrayLike) -> HeldAttitude:
    """Wheel momentum and torque that would hold an attitude, for the best arm branch.

    Redundant arms move with joint rates of least norm. The best branch completes the path with the
    smallest wheel momentum.

    Args:
        problem: Robot, path and momentum; momentum that its wheels store already counts as theirs.
        attitude: Attitude of the spacecraft, quaternion x, y, z, w.

    Raises:
        InputError: If the attitude is not one of the problem.
        UnreachableError: If no arm configuration reaches the start of the path.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> held = ff.hold_attitude(problem, [0.0, 0.0, 0.0, 1.0])
        >>> held.completed
        True
    """
    require_problem(problem)
    problem.model.require_one_arm("held attitudes")
    attitude = problem.attitude(attitude)
    branches = problem.branches(attitude)
    if not branches:
        accepted = "an attitude from which the arm reaches the start of the path"
        raise UnreachableError("attitude", f"{attitude.tolist()} was given", accepted)
    held = [_held(problem, attitude, branch) for branch in branches]
    return min(held, key=lambda entry: (-entry.times[-1], entry.largest_momentum))


def _held(problem: Problem, attitude: Array, branch: ArmBranch) -> HeldAttitude:
    times, joints, momenta, torques = [], [], [], []
    q = branch.joints
    edges = np.unique([0.0, *problem.path.breaks, problem.path.duration])
    for start, end in pairwise(edges.tolist()):
        segment = problem.path.timing.segment_at((start + end) / 2.0)
        held = _HeldArm(problem, attitude, segment)
        solution = solve_ivp(
            held.rates, (start, end), q, "DOP853", rtol=_TOLERANCE, atol=_TOLERANCE,
            dense_output=True, events=held.regularity,
        )  # fmt: skip
        t = np.linspace(start, solution.t[-1], _INSTANTS)
        states = solution.sol(t).T
        h = np.array([held.wheel_momentum(*at) for at in zip(t.tolist(), states, strict=True)])
        times.append(t)
        joints.append(states)
        momenta.append(h)
        torques.append(CubicSpline(t, h)(t, 1))
        q = states[-1]
        if solution.status:
            break
    completed = solution.status == 0
    drift = integrate_motion(problem, attitude, branch.joints)
    turn = float(angle_between(drift.attitudes, attitude).max())
    return HeldAttitude(
        attitude, branch, completed, frozen(np.concatenate(times)), frozen(np.concatenate(joints)),
        frozen(np.concatenate(momenta)), frozen(np.concatenate(torques)),
        turn if drift.completed else None,
    )  # fmt: skip


class _HeldArm:
    """The rates of the arm in a segment of the time law, the attitude being held."""

    def __init__(self, problem: Problem, attitude: Array, segment: int) -> None:
        self._problem, self._attitude, self._segment = problem, attitude, segment
        self._rotation = rotation_matrix(attitude)

    def _jacobian(self, joints: Array) -> tuple[Array, Array]:
        """Prescribed rows by joint rates (m, n), and the base's velocity by them (3, n)."""
        A = momentum_map(self._problem.model, joints, self._attitude)
        J = end_effector_jacobian(self._problem.model, joints, self._attitude)
        base = np.asarray(-np.linalg.solve(A[:3, :3], A[:3, 6:]), dtype=float)
        return self._prescribed(joints, J[:, 6:] + J[:, :3] @ base), base

    def _prescribed(self, joints: Array, twists: Array) -> Array:
        """Prescribed rows (m, k) of inertial twists (6, k)."""
        task = self._problem.task
        if task is Task.POINTING:  # its rows belong to the axes of the end-effector
            R = self._problem.model.end_effector_pose(self._attitude, joints).rotation
            twists = np.vstack([R.T @ twists[:3], R.T @ twists[3:]])
        return np.asarray(task_rows(self._problem.model, task, twists))

    def rates(self, t: float, joints: Array) -> Array:
        """Joint rates of least norm, shape (n,)."""
        twist, _ = self._problem.path.twist_and_speed(t, self._segment)
        J, _ = self._jacobian(joints)
        prescribed = self._prescribed(joints, twist[:, None])[:, 0]
        return np.asarray(np.linalg.lstsq(J, prescribed, rcond=None)[0])

    def regularity(self, t: float, joints: Array) -> float:
        """Falls through zero where the arm becomes singular."""
        sigma = np.linalg.svd(self._jacobian(joints)[0], compute_uv=False)
        return float(sigma[-1] / sigma[0] - _SINGULAR)

    regularity.terminal = True  # type: ignore[attr-defined]

    def wheel_momentum(self, t: float, joints: Array) -> Array:
        """The momentum that wheels have to store [N m s], spacecraft frame, shape (3,)."""
        q_rates = self.rates(t, joints)
        _, base = self._jacobian(joints)
        A = momentum_map(self._problem.model, joints, self._attitude)
        momentum = A[3:, :3] @ (base @ q_rates) + A[3:, 6:] @ q_rates
        return np.asarray(self._rotation.T @ (self._problem.momentum - momentum))
