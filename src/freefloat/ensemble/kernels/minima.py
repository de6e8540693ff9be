"""Minima of the measure inside the steps of motions in lock step."""

from __future__ import annotations

from freefloat.ensemble.kernels.interpolant import inside
from freefloat.ensemble.kernels.measures import measure_at
from freefloat.ensemble.kernels.records import (
    LOWEST,
    LOWEST_AT,
    SIGN,
    VALUE,
    Buffers,
    ProblemTables,
)
from freefloat.lockstep.compilation import inlined
from freefloat.lockstep.lanes import Float, Mask, any_of, magnitude, maximum, minimum, select
from freefloat.lockstep.tables import subtable

_DEPTH_FACTOR = 3.0
"""Assumed ratio of the depth of a minimum inside a step to the depth of a parabola."""
_SKEWED = 0.02
"""Assumed minimum depth, relative to the value: where the measure falls steeply and rises slowly,
the depth of the parabola is far too small."""
_PROBES = 4


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

    The parabola through the values at the beginning, middle and end tells whether to look for one.
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
