"""Newton's method for the joints of several arms in lock step, see :mod:`.arm_group`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from freefloat.lockstep.compilation import compiled, inlined, inner
from freefloat.lockstep.damped_steps import damped_step
from freefloat.lockstep.lanes import (
    WIDTH,
    Float,
    magnitude,
    maximum,
    select,
    sine_cosine,
    sqrt,
)
from freefloat.lockstep.tables import (
    Table,
    below,
    floats,
    get_lane,
    get_vector,
    lanes,
    set_lane,
    set_vector,
)
from freefloat.lockstep.vectors import Vector, components, cross, dot, vector
from freefloat.so3 import Array, IntArray

MOST_ARMS = 4
"""Number of arms for which there is room."""
LINKS, STROKES, PRISMATIC, FRAME_COLUMNS = 9, 15, 17, 18
"""Columns of ``Arms.joints``, behind the rotation, and their number."""
ROTATION, BEYOND, BASE_COLUMNS = 6, 15, 16
"""Columns of ``Arms.bases``, behind the first points, and their number."""
_AXIS, _POINT, _MOMENT = 0, 3, 6
_ROOM = 6 * MOST_ARMS
_SMALLEST = 1e-12
"""Smallest square of the cosine of half an angle: a rotation by pi has no direction."""


class Arms(NamedTuple):
    """Several arms and their task.

    Each is two chains with the same axes: the virtual manipulator, and that of the first moment,
    whose end is the displacement of the centre of mass.
    """

    number: int
    n: int  # joints
    m: int  # rows of the task
    pointing: bool
    joints: Table  # rotation of each joint's frame, whose z axis is the joint's, in the one before;
    # in this frame, the links of both chains behind the joint; their strokes; 1 where prismatic
    bases: Table  # of each arm: first points of both chains; rotation of the end-effector in the
    # last frame; number of the last joint plus one
    rows: Table  # of the end-effectors' twists that the task prescribes


class Workspace(NamedTuple):
    """Workspace of one thread."""

    q: Table
    targets: Table  # position and axes of each end-effector
    joints: Table  # axis of each joint, and its point of both chains
    ends: Table  # those of both chains of each arm
    J: Table  # columns of the Jacobian in rows
    normal: Table  # its rows' products, then their factors
    error: Table
    step: Table
    size: Table  # of the error
    moves: Table  # 1 in lanes that take the step


def make_workspace(n: int, arms: int) -> Workspace:
    """Workspace for arms with n joints in all."""
    shapes = (
        (n,), (arms, 12), (n, 9), (arms, 6), (n, _ROOM), (_ROOM, _ROOM), (_ROOM,), (n,), (1,), (1,),
    )  # fmt: skip
    return Workspace(*(np.zeros((*shape, WIDTH)) for shape in shapes))


@compiled
def solve_all(
    arms: Arms, targets: Array, pose: IntArray, q: Array, residual: Array, steps: int,
    exact: float, workspace: Workspace,
) -> None:  # fmt: skip
    """Replace joints by those to which Newton's method converges, and write the residuals.

    Args:
        arms: Arms.
        targets: Positions and axes of E end-effectors at K instants, shape (K, E, 12).
        pose: Instants, shape (N,).
        q: Joint values, shape (N, n).
        residual: Receives the residuals [m, rad], shape (N,).
        steps: Largest number of steps.
        exact: Residual at which the iteration stops.
        workspace: Workspace.
    """
    arms, work = in_tables(arms, workspace)
    owners, taken = np.full(WIDTH, -1), np.zeros(WIDTH, np.int64)
    following, busy = 0, 0
    for lane in range(min(WIDTH, len(q))):
        load(targets[pose[lane]], q[lane], lane, work)
        owners[lane] = lane
        following, busy = following + 1, busy + 1
    while busy > 0:
        work.size[0] = linearize(arms, work)
        for lane in range(WIDTH):
            k, size = owners[lane], get_lane(work.size, 0, lane)
            goes_on = k >= 0 and taken[lane] < steps and size > exact
            set_lane(work.moves, 0, lane, 1.0 if goes_on else 0.0)
            taken[lane] += 1
            if k < 0 or goes_on:
                continue
            residual[k] = size
            for j in range(arms.n):
                q[k, j] = get_lane(work.q, j, lane)
            owners[lane], taken[lane] = -1, 0
            if following == len(q):
                busy -= 1
                continue
            load(targets[pose[following]], q[following], lane, work)
            owners[lane] = following
            following += 1
        take_step(arms, work)


@inner
def in_tables(arms: Arms, work: Workspace) -> tuple[Arms, Workspace]:
    """Arrays as tables."""
    tables = Arms(
        arms.number, arms.n, arms.m, arms.pointing, floats(arms.joints, FRAME_COLUMNS),
        floats(arms.bases, BASE_COLUMNS), floats(arms.rows, 1),
    )  # fmt: skip
    return tables, Workspace(
        lanes(work.q, 1), lanes(work.targets, 12), lanes(work.joints, 9), lanes(work.ends, 6),
        lanes(work.J, _ROOM), lanes(work.normal, _ROOM), lanes(work.error, 1), lanes(work.step, 1),
        lanes(work.size, 1), lanes(work.moves, 1),
    )  # fmt: skip


@inner
def load(target: Array, q: Array, lane: int, work: Workspace) -> None:
    """Write targets (E, 12) and joints (n,) to a lane."""
    targets = below(work.targets, 0, 1)
    for e in range(len(target)):
        for i in range(12):
            set_lane(targets, 12 * e + i, lane, target[e, i])
    for j in range(len(q)):
        set_lane(work.q, j, lane, q[j])


@inlined
def take_step(arms: Arms, work: Workspace) -> None:
    """Add Levenberg's step, of at most one radian or metre per joint."""
    square = work.size[0] * work.size[0]
    damped_step(arms.m, arms.n, work.J, work.error, square, work.normal, work.step)
    largest = magnitude(work.step[0])
    for j in range(1, arms.n):
        largest = maximum(largest, magnitude(work.step[j]))
    share = 1.0 / maximum(largest, 1.0 + 0.0 * largest)
    for j in range(arms.n):
        work.q[j] = work.q[j] + select(work.moves[0] > 0.0, share * work.step[j], 0.0)


@inlined
def linearize(arms: Arms, work: Workspace) -> Float:
    """Write errors of the poses and their Jacobian; the errors' norm."""
    first, every = 0, vector(0.0, 0.0, 0.0)
    for e in range(arms.number):
        beyond = int(arms.bases[e, BEYOND])
        every = every + place_arm(arms, e, first, beyond, work)
        first = beyond
    first = 0
    for e in range(arms.number):
        beyond = int(arms.bases[e, BEYOND])
        for j in range(first, beyond):
            write_columns(arms, e, j, work)
        first = beyond
        end, moment = get_vector(work.ends, e, 0), get_vector(work.ends, e, 3)
        error = get_vector(work.targets, e, 0) + every - moment - end
        work.error[6 * e], work.error[6 * e + 1], work.error[6 * e + 2] = components(error)
    square = 0.0 * work.q[0]
    for i in range(arms.m):
        row = int(arms.rows[i])
        work.error[i] = work.error[row]
        square += work.error[i] * work.error[i]
        for j in range(arms.n):
            work.J[j, i] = work.J[j, row]
    return sqrt(square)


@inlined
def combination(ex: Vector, ey: Vector, ez: Vector, table: Table, row: int, column: int) -> Vector:
    """The vector whose components along axes are in a table of floats."""
    return ex * table[row, column] + ey * table[row, column + 1] + ez * table[row, column + 2]


@inlined
def place_arm(arms: Arms, e: int, first: int, beyond: int, work: Workspace) -> Vector:
    """Write axes and points of the joints of an arm, its ends, and the error of its rotation.

    Returns:
        The displacement of the centre of mass.
    """
    joints, bases, w = arms.joints, arms.bases, work.joints
    ex, ey, ez = vector(1.0, 0.0, 0.0), vector(0.0, 1.0, 0.0), vector(0.0, 0.0, 1.0)
    p = combination(ex, ey, ez, bases, e, 0)
    u = combination(ex, ey, ez, bases, e, 3)
    for j in range(first, beyond):
        x, y = combination(ex, ey, ez, joints, j, 0), combination(ex, ey, ez, joints, j, 3)
        ez = combination(ex, ey, ez, joints, j, 6)
        set_vector(w, j, _AXIS, ez)
        set_vector(w, j, _POINT, p)
        set_vector(w, j, _MOMENT, u)
        if joints[j, PRISMATIC] != 0.0:
            ex, ey = x, y
            p = p + ez * (work.q[j] * joints[j, STROKES])
            u = u + ez * (work.q[j] * joints[j, STROKES + 1])
        else:
            s, c = sine_cosine(work.q[j])
            ex, ey = x * c + y * s, y * c - x * s
        p = p + combination(ex, ey, ez, joints, j, LINKS)
        u = u + combination(ex, ey, ez, joints, j, LINKS + 3)
    set_vector(work.ends, e, 0, p)
    set_vector(work.ends, e, 3, u)
    x = combination(ex, ey, ez, bases, e, ROTATION)
    y = combination(ex, ey, ez, bases, e, ROTATION + 3)
    z = combination(ex, ey, ez, bases, e, ROTATION + 6)
    turn = rotation_rows(arms, e, rotation_error(arms, e, x, y, z, work), work)
    work.error[6 * e + 3], work.error[6 * e + 4], work.error[6 * e + 5] = components(turn)
    return u


@inlined
def rotation_error(arms: Arms, e: int, x: Vector, y: Vector, z: Vector, work: Workspace) -> Vector:
    """The axis of the rotation onto the wanted axes, times twice the sine of half its angle."""
    wanted = get_vector(work.targets, e, 9)
    across, cosine = cross(z, wanted), dot(z, wanted)
    if arms.pointing:
        square = (1.0 + cosine) * 0.5
    else:
        wanted_x, wanted_y = get_vector(work.targets, e, 3), get_vector(work.targets, e, 6)
        across = (across + cross(x, wanted_x) + cross(y, wanted_y)) * 0.5
        square = (1.0 + cosine + dot(x, wanted_x) + dot(y, wanted_y)) * 0.25
    return across * (1.0 / sqrt(maximum(square, _SMALLEST + 0.0 * square)))


@inlined
def rotation_rows(arms: Arms, e: int, omega: Vector, work: Workspace) -> Vector:
    """The components of an angular velocity from which the task takes its rows."""
    if not arms.pointing:
        return omega
    x, y = get_vector(work.targets, e, 3), get_vector(work.targets, e, 6)
    return vector(dot(omega, x), dot(omega, y), 0.0)


@inlined
def write_columns(arms: Arms, own: int, j: int, work: Workspace) -> None:
    """Write the twists of all end-effectors per rate of a joint of an arm."""
    w, J = work.joints, work.J
    axis = get_vector(w, j, _AXIS)
    if arms.joints[j, PRISMATIC] != 0.0:
        v, omega = axis * arms.joints[j, STROKES], axis * 0.0
        shift = axis * arms.joints[j, STROKES + 1]
    else:
        v, omega = cross(axis, get_vector(work.ends, own, 0) - get_vector(w, j, _POINT)), axis
        shift = cross(axis, get_vector(work.ends, own, 3) - get_vector(w, j, _MOMENT))
    for e in range(arms.number):
        set_vector(J, j, 6 * e, v if e == own else -shift)
        turn = rotation_rows(arms, e, omega, work)
        set_vector(J, j, 6 * e + 3, turn if e == own else turn * 0.0)
