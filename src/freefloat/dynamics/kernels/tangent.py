"""The flow of (8) by arc length compiled, for the integration of single motions."""

from __future__ import annotations

import math

from freefloat.dynamics.kernels.compilation import compiled, unowned
from freefloat.dynamics.kernels.elimination import eliminate
from freefloat.dynamics.kernels.equation import configure, form_jacobian
from freefloat.dynamics.kernels.right_side import flow
from freefloat.so3 import Array, IntArray


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
