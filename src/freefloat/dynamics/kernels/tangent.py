"""The flow of (8) by its own arc length compiled, for one motion followed precisely."""

from __future__ import annotations

import math

from freefloat.dynamics.kernels.compilation import borrowed, compiled
from freefloat.dynamics.kernels.equation import configure, eliminate, form_jacobian
from freefloat.dynamics.kernels.right_side import flow
from freefloat.so3 import Array, IntArray


@compiled
def tangent_at(
    bodies: Array, facts: Array, rows: IntArray, clock: Array, law: Array, tangents: Array,
    duration: float, h: Array, y: Array, reference: Array, f: Array, w: Array, S: Array, L: Array,
    vectors: Array,
) -> bool:  # fmt: skip
    """The unit tangent of the curve (time, attitude, joints) into ``f``, on ``reference``'s side.

    The first entry of ``y`` is time, in any unit; the first of ``f`` must hold the duration in that
    unit. ``clock``, ``law`` and ``tangents`` are a time law and a path that never change: twist and
    speed of the moment.

    Returns:
        Whether there is one: not where (4) is singular to the last digit.
    """
    return _tangent_at(
        borrowed(bodies), borrowed(facts), borrowed(rows), borrowed(clock), borrowed(law),
        borrowed(tangents), duration, borrowed(h), borrowed(y), borrowed(reference), borrowed(f),
        borrowed(w), borrowed(S), borrowed(L), borrowed(vectors),
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
    """Det S* of (6) at joint values; the last three are room."""
    configure(borrowed(bodies), borrowed(facts), borrowed(q), borrowed(w))
    form_jacobian(borrowed(facts), borrowed(rows), borrowed(w), borrowed(S))
    return eliminate(borrowed(S), borrowed(L))
