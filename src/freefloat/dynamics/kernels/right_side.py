"""The right-hand side of (8) compiled: rates of attitude and joints along a path.

By time for the integration of ensembles, by arc length for that of single motions; and the arrays
of a robot that the kernels read, see :mod:`freefloat.dynamics.kernels.equation`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from freefloat.dynamics.kernels.compilation import compiled, unowned
from freefloat.dynamics.kernels.elimination import eliminate
from freefloat.dynamics.kernels.equation import (
    FACTS,
    LEVEL,
    METRIC,
    OMEGA,
    configure,
    form_jacobian,
    solve_rates,
)
from freefloat.dynamics.kernels.null_space import choose_rates
from freefloat.dynamics.momentum import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.rigid_bodies import Body
from freefloat.so3 import Array, IntArray


class Robot(NamedTuple):
    """Data common to all motions of a problem, see :mod:`freefloat.dynamics.kernels.equation`."""

    bodies: Array
    facts: Array
    rows: IntArray
    measure: int
    ends: Array  # of the segments of the time law, (P,)
    origins: Array  # (P,)
    spans: Array  # (P,)
    law: (
        Array  # (P, 2, K): s and its derivative by time, highest power of (t - origin) / span first
    )
    # the path's tangent as cubics in s on N equal intervals of [0, 1], (N, 6, 4); for unequal
    # intervals (N, 7, 4), where the last row starts with their lower ends
    tangents: Array
    duration: float  # [s]


def robot_rows(model: FreeFloatingModel) -> Array:
    """Array ``bodies``: a row for the spacecraft and one for each body behind a joint."""
    return np.array([_row(body) for body in model.bodies])


def robot_facts(model: FreeFloatingModel, task: Task) -> Array:
    """Array ``facts``, zero where values of a measure or of a redundant arm belong."""
    facts = np.zeros(FACTS)
    facts[:LEVEL] = [
        model.total_mass, VirtualManipulator.of(model).reach, task.planar, *model.tool.position,
    ]  # fmt: skip
    return facts


def _row(body: Body) -> Array:
    """A body's row; the joint rotation follows Rodrigues' formula."""
    x, y, z = body.axis
    hat = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    P, inertia = body.placement.rotation, body.inertia
    return np.concatenate([
        body.placement.position, P.ravel(), (P @ hat).ravel(), (P @ hat @ hat).ravel(), body.axis,
        [body.prismatic, body.mass], body.centre,
        inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]], [1.0, np.nan],
    ])  # fmt: skip


@compiled
def twist_at(
    t: float, segment: int, origins: Array, spans: Array, law: Array, tangents: Array, twist: Array
) -> float:
    """Write the end-effector twist, inertial frame, at a time [s]; return the path speed [1/s]."""
    tau = (t - origins[segment]) / spans[segment]
    s, rate = 0.0, 0.0
    for k in range(law.shape[2]):
        s = s * tau + law[segment, 0, k]
        rate = rate * tau + law[segment, 1, k]
    cells = len(tangents)
    if tangents.shape[1] > 6:
        cell, beyond = 0, cells
        while beyond - cell > 1:
            middle = (cell + beyond) // 2
            if tangents[middle, 6, 0] <= s:
                cell = middle
            else:
                beyond = middle
        u = s - tangents[cell, 6, 0]
    else:
        position = s * cells
        cell = min(max(math.floor(position), 0), cells - 1)
        u = (position - cell) / cells
    for i in range(6):
        value = tangents[cell, i, 0]
        for k in range(1, 4):
            value = value * u + tangents[cell, i, k]
        twist[i] = rate * value
    return rate


@compiled
def flow(
    bodies: Array, facts: Array, rows: IntArray, origins: Array, spans: Array, law: Array,
    tangents: Array, duration: float, segment: int, h: Array, t: float, y: Array, f: Array,
    w: Array, S: Array, L: Array, q: Array, rates: Array, demand: Array,
) -> float:  # fmt: skip
    """Write the rate (8) of (attitude, joints), times the duration, into ``f``.

    Returns:
        det S, or sqrt(det(S S^T)).
    """
    n = len(q)
    norm = 1.0 / math.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2] + y[3] * y[3])
    a, b, c, e = norm * y[0], norm * y[1], norm * y[2], norm * y[3]
    for j in range(n):
        q[j] = y[4 + j]
    speed = twist_at(t * duration, segment, origins, spans, law, tangents, demand)
    R00, R01, R02 = 1 - 2 * (b * b + c * c), 2 * (a * b - c * e), 2 * (a * c + b * e)
    R10, R11, R12 = 2 * (a * b + c * e), 1 - 2 * (a * a + c * c), 2 * (b * c - a * e)
    R20, R21, R22 = 2 * (a * c - b * e), 2 * (b * c + a * e), 1 - 2 * (a * a + b * b)
    demand[6], demand[7], demand[8] = h[0], h[1], h[2]
    for j in (0, 3, 6):
        x, y_, z = demand[j], demand[j + 1], demand[j + 2]
        demand[j] = R00 * x + R10 * y_ + R20 * z
        demand[j + 1] = R01 * x + R11 * y_ + R21 * z
        demand[j + 2] = R02 * x + R12 * y_ + R22 * z
    if facts[METRIC] != 0.0:
        determinant = choose_rates(bodies, facts, rows, q, speed, demand, w, S, L, rates)
    else:
        configure(bodies, facts, q, w)
        determinant = solve_rates(facts, rows, demand, w, S, L, rates)
    x, y_, z = w[0, OMEGA] * duration, w[0, OMEGA + 1] * duration, w[0, OMEGA + 2] * duration
    f[0] = 0.5 * (e * x + b * z - c * y_)
    f[1] = 0.5 * (e * y_ + c * x - a * z)
    f[2] = 0.5 * (e * z + a * y_ - b * x)
    f[3] = -0.5 * (a * x + b * y_ + c * z)
    for j in range(n):
        f[4 + j] = rates[j] * duration
    return determinant


@compiled
def tangent_at(
    bodies: Array, facts: Array, rows: IntArray, clock: Array, law: Array, tangents: Array,
    duration: float, h: Array, y: Array, reference: Array, f: Array, w: Array, S: Array, L: Array,
    vectors: Array,
) -> bool:  # fmt: skip
    """Write the unit tangent of the curve (time, attitude, joints) into ``f``.

    Of its two directions the one with a positive product with ``reference`` is taken. The first
    entry of ``y`` is time, in any unit; that of ``f`` must hold the duration in the same unit.
    ``clock``, ``law`` and ``tangents`` describe a path of constant twist and speed.

    Returns:
        Whether the tangent exists: it does not where (4) is exactly singular.
    """
    return _tangent_at(
        unowned(bodies), unowned(facts), unowned(rows), unowned(clock), unowned(law),
        unowned(tangents), duration, unowned(h), unowned(y), unowned(reference), unowned(f),
        unowned(w), unowned(S), unowned(L), unowned(vectors),
    )  # fmt: skip


@compiled
def _tangent_at(
    bodies: Array, facts: Array, rows: IntArray, clock: Array, law: Array, tangents: Array,
    duration: float, h: Array, y: Array, reference: Array, f: Array, w: Array, S: Array, L: Array,
    vectors: Array,
) -> bool:  # fmt: skip
    n = S.shape[1]
    flow(
        bodies, facts, rows, clock[0], clock[1], law, tangents, duration, 0, h, 0.0, y[1:], f[1:],
        w, S, L, vectors[0, :n], vectors[1, :n], vectors[2],
    )  # fmt: skip
    square, along = 0.0, 0.0
    for j in range(len(f)):
        square += f[j] * f[j]
        along += f[j] * reference[j]
    if not math.isfinite(square):
        return False
    scale = math.copysign(1.0 / math.sqrt(square), along)
    for j in range(len(f)):
        f[j] *= scale
    return True


@compiled
def determinant_at(
    bodies: Array, facts: Array, rows: IntArray, q: Array, w: Array, S: Array, L: Array
) -> float:
    """Det S* of (6) at joint values; the last three arguments are buffers."""
    configure(unowned(bodies), unowned(facts), unowned(q), unowned(w))
    form_jacobian(unowned(facts), unowned(rows), unowned(w), unowned(S))
    return eliminate(unowned(S), unowned(L))
