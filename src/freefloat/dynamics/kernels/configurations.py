"""Configurations of a robot in lock step, whose results are arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from freefloat.dynamics.kernels.equation import form_jacobian
from freefloat.dynamics.kernels.kinematics import AXIS, LINEAR, POINT, TURN, X_AXIS
from freefloat.dynamics.kernels.robot import (
    Robot,
    Solver,
    make_solver,
    robot_in_tables,
    solver_in_tables,
)
from freefloat.lockstep.compilation import compiled, inner
from freefloat.lockstep.lanes import WIDTH
from freefloat.lockstep.tables import (
    Table,
    get_lane,
    lanes,
    set_lane,
    set_vector,
    subtable,
    workspace,
)
from freefloat.so3 import Array


class Configurations(NamedTuple):
    """A robot in K configurations, spacecraft frame from its origin.

    Attributes:
        frames: The x and z axes and the origin of each joint's link frame [m], and P, see
            :mod:`.kinematics`, shape (K, n, 4, 3).
        centres: Centres of mass of the system [m], shape (K, 3).
        inverses: D^-1, shape (K, 3, 3).
        turns: Angular velocities of the spacecraft per joint rate, ``-D^-1 Dq``, (K, 3, n).
    """

    frames: Array
    centres: Array
    inverses: Array
    turns: Array

    @classmethod
    def of(cls, robot: Robot, joints: Array, *, placed: bool = True) -> Configurations:
        """The configurations with joint values (K, n); without frames unless bodies are placed."""
        count, n = joints.shape
        shapes = (count if placed else 0, n, 4, 3), (count, 3), (count, 3, 3), (count, 3, n)
        configurations = cls(*map(np.empty, shapes))
        work = make_solver(n, robot.arms)
        q, inertia = workspace((n,), (6,))
        place_all(robot, np.ascontiguousarray(joints), q, inertia, work, configurations)
        return configurations


@compiled
def place_all(
    robot: Robot, joints: Array, q: Array, inertia: Array, work: Solver, out: Configurations
) -> None:
    """Write configurations with joint values (K, n); other arrays are workspace."""
    work, q, inertia = solver_in_tables(work), lanes(q, 1), lanes(inertia, 1)
    robot = robot_in_tables(robot, None, work)
    count = len(joints)
    for first in range(0, count, WIDTH):
        for lane in range(WIDTH):
            for j in range(robot.n):
                set_lane(q, j, lane, joints[min(first + lane, count - 1), j])
        _, inverse_D, _ = form_jacobian(robot, q, work)
        set_vector(subtable(inertia, 0, 3), 0, 0, inverse_D.diagonal)
        set_vector(subtable(inertia, 0, 3), 1, 0, inverse_D.products)
        for lane in range(min(WIDTH, count - first)):
            _store(robot, first + lane, lane, inertia, work, out)


@inner
def _store(
    robot: Robot, k: int, lane: int, inertia: Table, work: Solver, out: Configurations
) -> None:
    """Write the configuration in a lane."""
    for i in range(3):
        out.centres[k, i] = get_lane(subtable(work.centre, 0, 1), i, lane)
        out.inverses[k, i, i] = get_lane(inertia, i, lane)
        after, last = (i + 1) % 3, (i + 2) % 3
        out.inverses[k, after, last] = get_lane(inertia, 3 + i, lane)
        out.inverses[k, last, after] = get_lane(inertia, 3 + i, lane)
        for j in range(robot.n):
            out.turns[k, i, j] = get_lane(subtable(work.momenta, j, 1), TURN + i, lane)
    for j in range(robot.n if len(out.frames) else 0):
        w = subtable(work.momenta, j, 1)
        for i in range(3):
            for part, column in enumerate((X_AXIS, AXIS, POINT, LINEAR)):
                out.frames[k, j, part, i] = get_lane(w, column + i, lane)
