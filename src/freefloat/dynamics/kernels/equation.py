"""Equation (4) compiled: inertia and Jacobian matrices, joint rates and determinants.

The same quantities as in :mod:`freefloat.dynamics.momentum`, in the spacecraft frame and with its
linear velocity eliminated: ``D`` and ``Dq`` of (1), ``J`` for J12 of (5), ``S`` for S* of (7).
Kernels take few, plain arrays: passing an array costs as much as twenty products.

``bodies`` has a row for the spacecraft and one for each body behind a joint, with the columns

    OFFSET FIXED SINE COSINE AXIS   joint; rotation fixed + sin(q) sine + (1 - cos(q)) cosine
    PRISMATIC                       1 for a prismatic joint
    MASS CENTRE INERTIA             body; inertia xx yy zz xy xz yz about the centre of mass
    WEIGHT MIDDLE                   joint's weight in the metric; centre of its range or nan

and ``facts`` has the robot's scalars and vectors, the settings of a redundant arm last. ``w`` is
the workspace of a configuration, with a row for each body,

    ROT BODY                        rotation; centre of mass from the spacecraft's origin
    POINT LINE DQ JAC X             joint position and axis, columns of Dq, J and inverse(D) Dq
    MOMENTUM                        linear momentum per joint rate, for the energy metric alone

whose row 0 holds D, its inverse, the end-effector position from the centre of mass, the angular
velocity, and the centre of mass.
"""

from __future__ import annotations

import math

from freefloat.dynamics.kernels.compilation import compiled
from freefloat.dynamics.kernels.elimination import eliminate
from freefloat.so3 import Array, IntArray

OFFSET, FIXED, SINE, COSINE, AXIS, PRISMATIC = 0, 3, 12, 21, 30, 33
MASS, CENTRE, INERTIA = 34, 35, 38
WEIGHT, MIDDLE, BODY_COLUMNS = 44, 45, 46
TOTAL, REACH, PLANAR, TOOL, LEVEL = 0, 1, 2, 3, 6
METRIC, TOWARD, GAIN, BOUND, FACTS = 15, 16, 17, 18, 19
ROT, BODY, POINT, LINE, DQ, JAC, X, MOMENTUM, WORK_COLUMNS = 0, 9, 12, 15, 18, 21, 27, 30, 33
D, INVERSE, TIP, OMEGA, CENTRE_OF = 12, 18, 24, 27, 30
"""Columns of row 0 of the workspace."""
DEMAND = 9
"""Length of a demand: end-effector twist and angular momentum."""


@compiled
def configure(bodies: Array, facts: Array, q: Array, w: Array) -> None:
    """Write the matrices of (1) and (5) at joint values ``q`` into ``w``."""
    n = len(q)
    A00, A01, A02, A10, A11, A12, A20, A21, A22 = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
    for j in range(9):
        w[0, ROT + j] = 1.0 if j % 4 == 0 else 0.0
    x, y, z, cx, cy, cz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(n + 1):
        if k > 0:
            o0, o1, o2 = bodies[k, OFFSET], bodies[k, OFFSET + 1], bodies[k, OFFSET + 2]
            x += A00 * o0 + A01 * o1 + A02 * o2
            y += A10 * o0 + A11 * o1 + A12 * o2
            z += A20 * o0 + A21 * o1 + A22 * o2
            w[k, POINT], w[k, POINT + 1], w[k, POINT + 2] = x, y, z
            prismatic = bodies[k, PRISMATIC] != 0.0
            s, v = 0.0, 0.0
            if not prismatic:
                s, v = math.sin(q[k - 1]), 1.0 - math.cos(q[k - 1])
            for j in range(3):
                f0 = bodies[k, FIXED + j] + s * bodies[k, SINE + j] + v * bodies[k, COSINE + j]
                f1 = (
                    bodies[k, FIXED + 3 + j] + s * bodies[k, SINE + 3 + j]
                    + v * bodies[k, COSINE + 3 + j]
                )  # fmt: skip
                f2 = (
                    bodies[k, FIXED + 6 + j] + s * bodies[k, SINE + 6 + j]
                    + v * bodies[k, COSINE + 6 + j]
                )  # fmt: skip
                w[k, ROT + j] = A00 * f0 + A01 * f1 + A02 * f2
                w[k, ROT + 3 + j] = A10 * f0 + A11 * f1 + A12 * f2
                w[k, ROT + 6 + j] = A20 * f0 + A21 * f1 + A22 * f2
            A00, A01, A02 = w[k, ROT], w[k, ROT + 1], w[k, ROT + 2]
            A10, A11, A12 = w[k, ROT + 3], w[k, ROT + 4], w[k, ROT + 5]
            A20, A21, A22 = w[k, ROT + 6], w[k, ROT + 7], w[k, ROT + 8]
            o0, o1, o2 = bodies[k, AXIS], bodies[k, AXIS + 1], bodies[k, AXIS + 2]
            a0 = A00 * o0 + A01 * o1 + A02 * o2
            a1 = A10 * o0 + A11 * o1 + A12 * o2
            a2 = A20 * o0 + A21 * o1 + A22 * o2
            w[k, LINE], w[k, LINE + 1], w[k, LINE + 2] = a0, a1, a2
            if prismatic:
                x += q[k - 1] * a0
                y += q[k - 1] * a1
                z += q[k - 1] * a2
        o0, o1, o2 = bodies[k, CENTRE], bodies[k, CENTRE + 1], bodies[k, CENTRE + 2]
        o0, o1, o2 = (
            x + A00 * o0 + A01 * o1 + A02 * o2,
            y + A10 * o0 + A11 * o1 + A12 * o2,
            z + A20 * o0 + A21 * o1 + A22 * o2,
        )
        w[k, BODY], w[k, BODY + 1], w[k, BODY + 2] = o0, o1, o2
        cx += bodies[k, MASS] * o0
        cy += bodies[k, MASS] * o1
        cz += bodies[k, MASS] * o2
    scale = 1.0 / facts[TOTAL]
    cx, cy, cz = scale * cx, scale * cy, scale * cz
    o0, o1, o2 = facts[TOOL], facts[TOOL + 1], facts[TOOL + 2]
    w[0, TIP] = x + A00 * o0 + A01 * o1 + A02 * o2 - cx
    w[0, TIP + 1] = y + A10 * o0 + A11 * o1 + A12 * o2 - cy
    w[0, TIP + 2] = z + A20 * o0 + A21 * o1 + A22 * o2 - cz
    _composites(bodies, w, n, scale, cx, cy, cz)


@compiled
def _inertia(bodies: Array, w: Array, k: int) -> tuple[float, float, float, float, float, float]:
    """Inertia xx yy zz xy xz yz of a body about its centre of mass, in the spacecraft frame."""
    A00, A01, A02 = w[k, ROT], w[k, ROT + 1], w[k, ROT + 2]
    A10, A11, A12 = w[k, ROT + 3], w[k, ROT + 4], w[k, ROT + 5]
    A20, A21, A22 = w[k, ROT + 6], w[k, ROT + 7], w[k, ROT + 8]
    xx, yy, zz = bodies[k, INERTIA], bodies[k, INERTIA + 1], bodies[k, INERTIA + 2]
    xy, xz, yz = bodies[k, INERTIA + 3], bodies[k, INERTIA + 4], bodies[k, INERTIA + 5]
    a0, a1, a2 = (
        A00 * xx + A01 * xy + A02 * xz,
        A00 * xy + A01 * yy + A02 * yz,
        A00 * xz + A01 * yz + A02 * zz,
    )
    b0, b1, b2 = (
        A10 * xx + A11 * xy + A12 * xz,
        A10 * xy + A11 * yy + A12 * yz,
        A10 * xz + A11 * yz + A12 * zz,
    )
    c0, c1, c2 = (
        A20 * xx + A21 * xy + A22 * xz,
        A20 * xy + A21 * yy + A22 * yz,
        A20 * xz + A21 * yz + A22 * zz,
    )
    return (
        a0 * A00 + a1 * A01 + a2 * A02,
        b0 * A10 + b1 * A11 + b2 * A12,
        c0 * A20 + c1 * A21 + c2 * A22,
        a0 * A10 + a1 * A11 + a2 * A12,
        a0 * A20 + a1 * A21 + a2 * A22,
        b0 * A20 + b1 * A21 + b2 * A22,
    )


@compiled
def _composites(
    bodies: Array, w: Array, n: int, scale: float, cx: float, cy: float, cz: float
) -> None:
    """Columns of Dq and J from the tip inward, by the composite body that each joint moves.

    ``M`` is its mass, ``u`` its first moment and ``xx`` to ``yz`` its inertia, about the system's
    centre of mass; ``scale`` is one over the total mass.
    """
    M, ux, uy, uz = 0.0, 0.0, 0.0, 0.0
    xx, yy, zz, xy, xz, yz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    r0, r1, r2 = w[0, TIP], w[0, TIP + 1], w[0, TIP + 2]
    for k in range(n, -1, -1):
        mass = bodies[k, MASS]
        if mass > 0.0:
            x, y, z = w[k, BODY] - cx, w[k, BODY + 1] - cy, w[k, BODY + 2] - cz
            M += mass
            ux += mass * x
            uy += mass * y
            uz += mass * z
            Ixx, Iyy, Izz, Ixy, Ixz, Iyz = _inertia(bodies, w, k)
            xx += Ixx + mass * (y * y + z * z)
            yy += Iyy + mass * (x * x + z * z)
            zz += Izz + mass * (x * x + y * y)
            xy += Ixy - mass * x * y
            xz += Ixz - mass * x * z
            yz += Iyz - mass * y * z
        if k == 0:
            break
        a0, a1, a2 = w[k, LINE], w[k, LINE + 1], w[k, LINE + 2]
        if bodies[k, PRISMATIC] != 0.0:
            w[k, DQ], w[k, DQ + 1] = uy * a2 - uz * a1, uz * a0 - ux * a2
            w[k, DQ + 2] = ux * a1 - uy * a0
            stroke = 1.0 - M * scale
            w[k, JAC], w[k, JAC + 1], w[k, JAC + 2] = stroke * a0, stroke * a1, stroke * a2
            w[k, JAC + 3], w[k, JAC + 4], w[k, JAC + 5] = 0.0, 0.0, 0.0
            continue
        x, y, z = w[k, POINT] - cx, w[k, POINT + 1] - cy, w[k, POINT + 2] - cz
        # velocity that the joint's rotation would give a point at the centre of mass
        e0, e1, e2 = (
            y * a2 - z * a1,
            z * a0 - x * a2,
            x * a1 - y * a0,
        )
        w[k, DQ] = xx * a0 + xy * a1 + xz * a2 + uy * e2 - uz * e1
        w[k, DQ + 1] = xy * a0 + yy * a1 + yz * a2 + uz * e0 - ux * e2
        w[k, DQ + 2] = xz * a0 + yz * a1 + zz * a2 + ux * e1 - uy * e0
        ratio = 1.0 - M * scale
        x = r0 - ratio * x - scale * ux
        y = r1 - ratio * y - scale * uy
        z = r2 - ratio * z - scale * uz
        w[k, JAC], w[k, JAC + 1], w[k, JAC + 2] = a1 * z - a2 * y, a2 * x - a0 * z, a0 * y - a1 * x
        w[k, JAC + 3], w[k, JAC + 4], w[k, JAC + 5] = a0, a1, a2
    w[0, D], w[0, D + 1], w[0, D + 2] = xx, yy, zz
    w[0, D + 3], w[0, D + 4], w[0, D + 5] = xy, xz, yz


@compiled
def form_jacobian(facts: Array, rows: IntArray, w: Array, S: Array) -> float:
    """Write ``S`` of (7) at the configuration; return det D, for planar tasks its zz element."""
    xx, yy, zz = w[0, D], w[0, D + 1], w[0, D + 2]
    xy, xz, yz = w[0, D + 3], w[0, D + 4], w[0, D + 5]
    cxx, cxy, cxz = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    determinant = xx * cxx + xy * cxy + xz * cxz
    scale = 1.0 / determinant
    ixx, ixy, ixz = scale * cxx, scale * cxy, scale * cxz
    iyy, iyz, izz = (
        scale * (xx * zz - xz * xz), scale * (xy * xz - xx * yz), scale * (xx * yy - xy * xy),
    )  # fmt: skip
    w[0, INVERSE], w[0, INVERSE + 1], w[0, INVERSE + 2] = ixx, iyy, izz
    w[0, INVERSE + 3], w[0, INVERSE + 4], w[0, INVERSE + 5] = ixy, ixz, iyz
    r0, r1, r2 = w[0, TIP], w[0, TIP + 1], w[0, TIP + 2]
    pose = len(rows) == 6
    for j in range(S.shape[1]):
        d0, d1, d2 = w[j + 1, DQ], w[j + 1, DQ + 1], w[j + 1, DQ + 2]
        x = ixx * d0 + ixy * d1 + ixz * d2
        y = ixy * d0 + iyy * d1 + iyz * d2
        z = ixz * d0 + iyz * d1 + izz * d2
        w[j + 1, X], w[j + 1, X + 1], w[j + 1, X + 2] = x, y, z
        s0 = w[j + 1, JAC] - (y * r2 - z * r1)
        s1 = w[j + 1, JAC + 1] - (z * r0 - x * r2)
        s2 = w[j + 1, JAC + 2] - (x * r1 - y * r0)
        s3, s4, s5 = w[j + 1, JAC + 3] - x, w[j + 1, JAC + 4] - y, w[j + 1, JAC + 5] - z
        if pose:
            S[0, j], S[1, j], S[2, j], S[3, j], S[4, j], S[5, j] = s0, s1, s2, s3, s4, s5
        else:
            for k in range(len(rows)):
                S[k, j] = (s0, s1, s2, s3, s4, s5)[rows[k]]
    return float(zz if facts[PLANAR] != 0.0 else determinant)


@compiled
def solve_rates(
    facts: Array, rows: IntArray, demand: Array, w: Array, S: Array, L: Array, rates: Array
) -> float:
    """Solve equation (4) at the configuration that :func:`configure` wrote into ``w``.

    Args:
        facts: Scalars of the robot.
        rows: Rows of the task.
        demand: End-effector twist and angular momentum, spacecraft frame, shape (9,); the twist due
            to the momentum is subtracted.
        w: Workspace; receives the spacecraft's angular velocity.
        S: Buffer, shape (m, n).
        L: Buffer, shape (m, m + 1).
        rates: Receives the joint rates, shape (n,).

    Returns:
        det S, or sqrt(det(S S^T)).
    """
    form_jacobian(facts, rows, w, S)
    m, n = S.shape
    ixx, iyy, izz = w[0, INVERSE], w[0, INVERSE + 1], w[0, INVERSE + 2]
    ixy, ixz, iyz = w[0, INVERSE + 3], w[0, INVERSE + 4], w[0, INVERSE + 5]
    h0, h1, h2 = demand[6], demand[7], demand[8]
    x = ixx * h0 + ixy * h1 + ixz * h2
    y = ixy * h0 + iyy * h1 + iyz * h2
    z = ixz * h0 + iyz * h1 + izz * h2
    r0, r1, r2 = w[0, TIP], w[0, TIP + 1], w[0, TIP + 2]
    demand[0] -= y * r2 - z * r1
    demand[1] -= z * r0 - x * r2
    demand[2] -= x * r1 - y * r0
    demand[3] -= x
    demand[4] -= y
    demand[5] -= z
    for k in range(m):
        L[k, m] = demand[rows[k]]
    determinant = eliminate(S, L)
    for k in range(m - 1, -1, -1):
        total = L[k, m]
        for j in range(k + 1, m):
            total -= L[k, j] * L[j, m]
        L[k, m] = total / L[k, k]
    for j in range(n):
        if m == n:
            rates[j] = L[j, m]
        else:
            total = 0.0
            for k in range(m):
                total += S[k, j] * L[k, m]
            rates[j] = total
        x -= w[j + 1, X] * rates[j]
        y -= w[j + 1, X + 1] * rates[j]
        z -= w[j + 1, X + 2] * rates[j]
    w[0, OMEGA], w[0, OMEGA + 1], w[0, OMEGA + 2] = x, y, z
    return determinant
