"""Random descents to the points of a claim that come nearest to breaking it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

POINTS, DESCENTS, TRIES, ROUNDS = 3000, 24, 8, 12
"""Random points of a claim, descents from the worst of them, their points a round, and rounds."""

Value = Callable[[np.ndarray], np.ndarray]
"""How far points (K, D) are from breaking a claim, (K,): below 1 they break it or nearly do."""


def lowest(
    value: Value, points: np.ndarray, inside: Value, size: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, int]:
    """The lowest points found by random descents, their values, and how many were tried.

    Descents begin from the lowest of some points; ``inside`` moves points into the claim.
    """
    points = inside(points)
    values = value(points)
    tried = len(points)
    order = np.argsort(values)
    worst = [*order[: DESCENTS // 2], *rng.choice(order, DESCENTS - DESCENTS // 2)]
    best, low = points[worst].copy(), values[worst].copy()
    sizes = np.full(len(worst), size)
    for _ in range(ROUNDS):
        steps = rng.normal(size=(len(best), TRIES, points.shape[1]))
        steps *= rng.uniform(0.05, 1.0, (len(best), TRIES, 1)) * sizes[:, None, None]
        moved = inside((best[:, None] + steps).reshape(-1, points.shape[1]))
        found = value(moved).reshape(len(best), TRIES)
        tried += len(moved)
        least = found.argmin(axis=1)
        lower = found.min(axis=1) < low
        best[lower] = moved.reshape(len(best), TRIES, -1)[lower, least[lower]]
        low = np.minimum(low, found.min(axis=1))
        sizes = np.where(lower, sizes, 0.6 * sizes)
    order = np.argsort(low)
    return best[order], low[order], tried


def in_ball(radius: float) -> Value:
    """Moves vectors into a ball."""

    def moved(vectors: np.ndarray) -> np.ndarray:
        lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
        return vectors * np.minimum(1.0, radius / np.maximum(lengths, 1e-300))

    return moved


def ball(rng: np.random.Generator, radius: float) -> np.ndarray:
    """Random vectors, half of them on the sphere, half inside."""
    vectors = rng.normal(size=(POINTS, 3))
    vectors *= radius / np.linalg.norm(vectors, axis=1, keepdims=True)
    vectors[::2] *= rng.uniform(size=(len(vectors[::2]), 1)) ** (1.0 / 3.0)
    return vectors
