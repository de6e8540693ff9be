"""Records of a robot that kernels read and write: arrays for callers, tables in the kernels."""

from __future__ import annotations

from typing import NamedTuple

from freefloat.lockstep.compilation import inlined, inner
from freefloat.lockstep.tables import (
    Table,
    first_if_none,
    floats,
    lanes,
    set_lane,
    subtable,
    workspace,
)
from freefloat.so3 import Array

MOST_ARMS = 4
"""Number of arms on paths for which there is room."""
FRAME_COLUMNS, BODY_COLUMNS, JOINT_COLUMNS, TOOL_COLUMNS, END_COLUMNS = 8, 10, 18, 14, 22
"""Numbers of columns of ``Robot.joints``, of bodies, ``Solver.momenta``, ``Robot.tools`` and
``Solver.ends``."""
COSINE, SINE, ALONG_X, ANGLE, ALONG_Z, PRISMATIC, TILT_COSINE, TILT_SINE = range(FRAME_COLUMNS)
"""Columns of ``Robot.joints``, see :class:`freefloat.dynamics.denavit_hartenberg.LinkFrames`."""
MASS, MOMENT, DIAGONAL, PRODUCTS = 0, 1, 4, 7
"""Columns of the bodies."""
TOTAL_MASS, REACH, BASES, BASE_SIZE = 0, 1, 2, 12
"""First places of what ``Robot.properties`` has: total mass; reach; for each arm, link frame 0 in
the spacecraft frame, x, y and z axes and origin; then rows of the bodies, for each arm the row of
the spacecraft in link frame 0 and rows of the links in theirs; coefficients of measure ``arm``."""
FIRST, BEYOND, TOOL = 0, 1, 2
"""Columns of ``Robot.tools``: numbers of the arm's first joint and of the joint behind its last;
position and x, y and z axes of the end-effector in the last link frame."""
S_COLUMNS = 6 * MOST_ARMS


class FurtherArms(NamedTuple):
    """Further arms that move along joint curves, as part of the spacecraft."""

    number: int  # of cells of equal duration; 0 where no further arm moves
    density: float  # cells per second
    cells: Table  # cubics of each cell, highest power first: first moment in link frame 0, angular
    # momentum relative to the spacecraft and about its origin, in its frame, inertia as the first


class Robot(NamedTuple):
    """A robot whose arms follow paths, and its task.

    See :class:`freefloat.dynamics.denavit_hartenberg.LinkFrames`.
    """

    joints: Table  # of one arm after the other, (n, 8)
    properties: Table  # what may differ between the robots of the motions, one row
    tools: Table  # of the arms, (arms, 14)
    root: Table  # the spacecraft in its own frame, which is read of several arms, (1, 10)
    rows: Table  # of the end-effectors' twists that the task prescribes, (m,)
    arms: int
    n: int
    m: int
    planar: bool
    on_table: bool  # the spacecraft moves along x and y and turns about z only
    pointing: bool
    singular_speed: float  # of joints per duration, above which a redundant arm is singular
    further: FurtherArms


class Solver(NamedTuple):
    """Workspace of one thread, in which equation (4) is solved."""

    momenta: Table  # of the joints, see freefloat.dynamics.kernels.kinematics, (n, 18)
    ends: Table  # of the arms, see there, (arms, 22)
    centre: Table  # of mass
    carried: Table  # linear and angular momentum of further arms, relative to the spacecraft
    twists: Table  # of the end-effectors, spacecraft frame, (arms, 6)
    S: Table  # columns of S* in rows, then its factors, (n, 24)
    scales: Table
    b: Table
    rates: Table
    properties: Table  # of the motions' robots, see ``Robot.properties``; empty where all are equal


def make_solver(n: int, arms: int, properties: int = 0) -> Solver:
    """Workspace for a robot of n joints of some arms, and so many properties that differ."""
    shapes = (
        (n, JOINT_COLUMNS), (arms, END_COLUMNS), (1, 3), (2, 3), (arms, 6), (n, S_COLUMNS),
        (6 * arms,), (6 * arms,), (n,), (properties,),
    )  # fmt: skip
    return Solver(*workspace(*shapes))


@inner
def solver_in_tables(work: Solver) -> Solver:
    """A workspace's arrays as tables."""
    return Solver(
        lanes(work.momenta, JOINT_COLUMNS), lanes(work.ends, END_COLUMNS), lanes(work.centre, 3),
        lanes(work.carried, 3), lanes(work.twists, 6), lanes(work.S, S_COLUMNS),
        lanes(work.scales, 1), lanes(work.b, 1), lanes(work.rates, 1), lanes(work.properties, 1),
    )  # fmt: skip


@inner
def robot_in_tables(robot: Robot, robots: Array | None, work: Solver) -> Robot:
    """A robot's arrays as tables; properties of robots that differ are in the lanes."""
    further = robot.further
    return Robot(
        floats(robot.joints, FRAME_COLUMNS),
        first_if_none(robots, floats(robot.properties, 1), work.properties),
        floats(robot.tools, TOOL_COLUMNS), floats(robot.root, BODY_COLUMNS), floats(robot.rows, 1),
        robot.arms, robot.n, robot.m, robot.planar, robot.on_table, robot.pointing,
        robot.singular_speed,
        FurtherArms(further.number, further.density, floats(further.cells, 1)),
    )  # fmt: skip


@inner
def load_robot(robots: Array | None, k: int, lane: int, work: Solver) -> None:
    """Write the properties of robot k to a lane, unless they are equal for all robots."""
    if robots is not None:
        for j in range(robots.shape[1]):
            set_lane(work.properties, j, lane, robots[k, j])


@inlined
def base_of(robot: Robot, arm: int) -> Table:
    """Link frame 0 of an arm in the spacecraft frame: x, y and z axes and origin."""
    return subtable(robot.properties, BASES + BASE_SIZE * arm, 3)


@inlined
def joints_of(robot: Robot, arm: int) -> range:
    """Numbers of the joints of an arm."""
    return range(int(robot.tools[arm, FIRST]), int(robot.tools[arm, BEYOND]))


@inlined
def bodies_of(robot: Robot) -> Table:
    """Rows of mass, first moment and inertia of the bodies, in their link frames."""
    return subtable(robot.properties, BASES + BASE_SIZE * robot.arms, BODY_COLUMNS)


@inlined
def coefficients_of(robot: Robot) -> Table:
    """Coefficients of the measure ``arm``."""
    bodies = BODY_COLUMNS * (robot.arms + robot.n)
    return subtable(robot.properties, BASES + BASE_SIZE * robot.arms + bodies, 2)
