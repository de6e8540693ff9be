"""Singularity measures of motions in lock step, with their signs, and their minima inside steps."""

from __future__ import annotations

from freefloat.dynamics.kernels.equation import form_jacobian
from freefloat.dynamics.kernels.robot import PRISMATIC, REACH, Robot, coefficients_of
from freefloat.ensemble.kernels.dormand_prince import inside
from freefloat.ensemble.kernels.records import (
    LOWEST,
    LOWEST_AT,
    SIGN,
    VALUE,
    Buffers,
    Measure,
    ProblemTables,
)
from freefloat.lockstep.compilation import inlined, inner
from freefloat.lockstep.factors import factorize
from freefloat.lockstep.lanes import (
    Float,
    Mask,
    any_of,
    magnitude,
    maximum,
    minimum,
    select,
    sine_cosine,
    sqrt,
)
from freefloat.lockstep.tables import Table, subtable

GJM, SYSTEM, ARM, SIGMA = 0, 1, 2, 3
"""Codes of the measures, in the order of ``freefloat.dynamics.measures.KEYS``."""
_DEPTH_FACTOR = 3.0
"""Assumed ratio of the depth of a minimum inside a step to the depth of a parabola."""
_SKEWED = 0.02
"""Assumed minimum depth, relative to the value: where the measure falls steeply and rises slowly,
the depth of the parabola is far too small."""
_PROBES = 4
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


@inlined
def value_inside(problem: ProblemTables, dt: Float, x: Float, work: Buffers) -> Float:
    """The measure at a fraction of the step, with the sign of the motion's first value."""
    inside(problem, dt, x, 4, work)
    q = subtable(work.inside, 4, 1)
    return work.status[SIGN] * measure_at(problem.robot, problem.measure, q, work)


@inlined
def note_minimum(
    problem: ProblemTables, dt: Float, after: Float, accepted: Mask, work: Buffers
) -> None:
    """Update the minimum by the value at the end of a step, and by a minimum inside.

    The latter is searched for where the parabola through three values of the step has a minimum.
    """
    status, T = work.status, 4 + problem.robot.n
    lower = accepted & (after < status[LOWEST])
    status[LOWEST] = select(lower, after, status[LOWEST])
    status[LOWEST_AT] = select(lower, work.at[T], status[LOWEST_AT])
    before, middle = status[VALUE], value_inside(problem, dt, 0.0 * dt + 0.5, work)
    curvature = 2.0 * (before + after - 2.0 * middle)
    slope = 4.0 * middle - 3.0 * before - after
    place = -0.5 * slope / curvature
    low = minimum(before, minimum(middle, after))
    depth = maximum(_DEPTH_FACTOR * (low - before - 0.5 * slope * place), _SKEWED * low)
    dips = (curvature > 0.0) & (place > -0.1) & (place < 1.1) & (low - depth < status[LOWEST])
    dips = accepted & (dips | (middle < status[LOWEST]))
    if any_of(dips):
        found, place = local_minimum(problem, dt, before, middle, after, work)
        lower = dips & (found < status[LOWEST])
        inside(problem, dt, place, 4, work)
        status[LOWEST] = select(lower, found, status[LOWEST])
        status[LOWEST_AT] = select(lower, work.inside[T], status[LOWEST_AT])


@inlined
def local_minimum(
    problem: ProblemTables, dt: Float, before: Float, middle: Float, after: Float, work: Buffers
) -> tuple[Float, Float]:
    """The lowest value of the measure inside a step and its place, by successive parabolas."""
    a, fa, b, fb, c, fc = 0.0 * dt, before, 0.0 * dt + 0.5, middle, 0.0 * dt + 1.0, after
    for _ in range(_PROBES):
        p, r = (b - a) * (fb - fc), (b - c) * (fb - fa)
        x = b - 0.5 * ((b - a) * p - (b - c) * r) / (p - r)
        longer = select(c - b > b - a, c - b, a - b)
        distance = magnitude(x - b)
        aside = b + select(distance > 0.0, 0.1 * longer, 0.02 * longer)
        x = select(distance > 0.02 * (c - a), x, aside)
        x = minimum(maximum(x, a + 0.05 * (b - a)), c - 0.05 * (c - b))
        fx = value_inside(problem, dt, x, work)
        lower, beyond = fx < fb, x > b
        ahead, behind = lower & beyond, lower & ~beyond
        a, fa = select(ahead, b, a), select(ahead, fb, fa)
        c, fc = select(behind, b, c), select(behind, fb, fc)
        ahead, behind = ~lower & beyond, ~lower & ~beyond
        c, fc = select(ahead, x, c), select(ahead, fx, fc)
        a, fa = select(behind, x, a), select(behind, fx, fa)
        b, fb = select(lower, x, b), select(lower, fx, fb)
    return fb, b
