"""Singularity measures of motions in lock step, with their signs."""

from __future__ import annotations

from freefloat.dynamics.kernels.equation import form_jacobian
from freefloat.dynamics.kernels.robot import PRISMATIC, REACH, Robot, coefficients_of
from freefloat.ensemble.kernels.records import Buffers, Measure
from freefloat.lockstep.compilation import inlined, inner
from freefloat.lockstep.lanes import Float, any_of, magnitude, minimum, select, sine_cosine, sqrt
from freefloat.lockstep.reflections import factorize
from freefloat.lockstep.tables import Table

GJM, SYSTEM, ARM, SIGMA = 0, 1, 2, 3
"""Codes of the measures, in the order of ``freefloat.dynamics.measures.KEYS``."""
_SWEEPS = 12
_ORTHOGONAL = 1e-14


@inner
def measure_at(robot: Robot, measure: Measure, q: Table, work: Buffers) -> Float:
    """The measure at joint values."""
    if measure.code == ARM:
        return polynomial(robot, measure, q)
    _, _, det_D = form_jacobian(robot, q, work.solver)
    if measure.code == SIGMA:
        return smallest_singular_value(robot, work.solver.S)
    determinant = factorize(robot.m, robot.n, work.solver.S, work.solver.scales)
    return of_determinants(measure, determinant, det_D)


@inlined
def of_determinants(measure: Measure, determinant: Float, det_D: Float) -> Float:
    """The measure ``gjm`` or ``system`` where det S* and det D are known."""
    if measure.code == GJM:
        return determinant
    return determinant * det_D


@inlined
def polynomial(robot: Robot, measure: Measure, q: Table) -> Float:
    """The measure ``arm``: the sum of a cos(k q2 + l q3) + b sin(k q2 + l q3), multiples k, l."""
    coefficients = coefficients_of(robot)
    total = 0.0 * q[1]
    for i in range(measure.terms):
        s, c = sine_cosine(q[1] * measure.multiples[i, 0] + q[2] * measure.multiples[i, 1])
        total += c * coefficients[i, 0] + s * coefficients[i, 1]
    return total


@inner
def smallest_singular_value(robot: Robot, S: Table) -> Float:
    """The smallest singular value of S*, lengths in units of the reach; overwrites ``S``.

    By Jacobi rotations of pairs of rows of S* until all are orthogonal (Hestenes 1958).
    """
    m, n, reach = robot.m, robot.n, robot.properties[REACH]
    for j in range(n):
        factor = reach if robot.joints[j, PRISMATIC] != 0.0 else 1.0
        for i in range(m):
            S[j, i] = S[j, i] * (factor / reach if robot.rows[i] % 6.0 < 3.0 else factor)
    for _ in range(_SWEEPS):
        largest = 0.0 * S[0, 0]
        for i in range(m):
            for k in range(i + 1, m):
                ii, ik, kk = 0.0 * S[0, 0], 0.0 * S[0, 0], 0.0 * S[0, 0]
                for j in range(n):
                    ii += S[j, i] * S[j, i]
                    ik += S[j, i] * S[j, k]
                    kk += S[j, k] * S[j, k]
                aligned = ik * ik > _ORTHOGONAL * _ORTHOGONAL * ii * kk
                largest = select(aligned, 1.0, largest)
                zeta = (kk - ii) / select(aligned, ik + ik, 1.0)
                size = 1.0 / (magnitude(zeta) + sqrt(1.0 + zeta * zeta))
                t = select(aligned, select(zeta < 0.0, -size, size), 0.0)
                c = 1.0 / sqrt(1.0 + t * t)
                s = c * t
                for j in range(n):
                    x, y = S[j, i], S[j, k]
                    S[j, i] = c * x - s * y
                    S[j, k] = s * x + c * y
        if not any_of(largest > 0.0):
            break
    least = 0.0 * S[0, 0]
    for i in range(m):
        square = 0.0 * S[0, 0]
        for j in range(n):
            square += S[j, i] * S[j, i]
        least = square if i == 0 else minimum(least, square)
    return sqrt(least)
