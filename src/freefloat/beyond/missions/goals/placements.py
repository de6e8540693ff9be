"""Placements of a robot's bodies in many configurations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from freefloat.dynamics.denavit_hartenberg import frames_at_zero, joints_at_zero, link_frames
from freefloat.dynamics.kernels.equation import form_jacobian
from freefloat.dynamics.kernels.kinematics import AXIS, LINEAR, POINT, TURN, X_AXIS
from freefloat.dynamics.kernels.robot import (
    Robot,
    Solver,
    make_solver,
    robot_in_tables,
    solver_in_tables,
)
from freefloat.dynamics.robot_arrays import kernel_robot
from freefloat.dynamics.tasks import Task
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
from freefloat.robot.base import HORIZONTAL
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, BoolArray, IntArray


class Configurations(NamedTuple):
    """A robot in K configurations, spacecraft frame from its origin."""

    frames: Array  # x and z axes and origin of link frames [m], P of the kinematics, (K, n, 4, 3)
    centres: Array  # centres of mass of the system [m], (K, 3)
    inverses: Array  # D^-1, (K, 3, 3)
    turns: Array  # angular velocities of the spacecraft per joint rate, ``-D^-1 Dq``, (K, 3, n)

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


@dataclass(frozen=True, eq=False)
class PlacedArm:
    """A robot in many configurations."""

    robot: Robot  # for the kernels
    prismatic: BoolArray  # (n,)
    mass: float  # of the system [kg]
    rotations: Array  # rotations of the bodies' frames in their link frames, (n, 3, 3)
    origins: Array  # origins of the bodies' frames in their link frames [m], (n, 3)

    @classmethod
    def of(cls, model: FreeFloatingModel) -> PlacedArm:
        """The data of a robot."""
        frames, (_, points, turns) = frames_at_zero(link_frames(model))[1:], joints_at_zero(model)
        origins = (frames[:, :3] @ (points - frames[:, 3])[..., None])[..., 0]
        return cls(
            kernel_robot(model, Task.POSE), np.array(model.prismatic), float(model.total_mass),
            frames[:, :3] @ turns, origins,
        )  # fmt: skip


class Placements(NamedTuple):
    """The bodies in K configurations, in the spacecraft frame from its origin."""

    rotations: Array  # rotations of the bodies' frames, (K, 1 + n, 3, 3)
    origins: Array  # origins of the bodies' frames [m], (K, 1 + n, 3)
    axes: Array  # of the joints, (K, n, 3)
    centres: Array  # centres of mass of the system, on a table below or above them [m], (K, 3)
    centre_rates: Array  # derivatives of the centres by the joints, (K, 3, n)

    @classmethod
    def of(cls, arm: PlacedArm, joints: Array) -> Placements:
        """Placements at joint values (K, n)."""
        frames, centres, _, _ = Configurations.of(arm.robot, joints)
        x, axes, points, P = np.moveaxis(frames, 2, 0)
        turned = np.stack([x, np.cross(axes, x), axes], axis=-1)
        moved = np.where(arm.prismatic[:, None], axes, np.cross(axes, centres[:, None] - points))
        rates = (moved - P / arm.mass).swapaxes(1, 2)
        if arm.robot.on_table:  # origins are at the height of the spacecraft
            centres, rates = centres * HORIZONTAL, rates * HORIZONTAL[:, None]
        origins = points + (turned @ arm.origins[..., None])[..., 0]
        first = np.broadcast_to(np.eye(3), (len(joints), 1, 3, 3))
        return cls(
            np.concatenate([first, turned @ arm.rotations], axis=1),
            np.concatenate([0.0 * centres[:, None], origins], axis=1),
            axes, centres, rates,
        )  # fmt: skip

    def taken(self, rows: IntArray) -> Placements:
        """Some of the configurations."""
        return Placements(*(array[rows] for array in self))
