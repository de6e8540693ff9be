"""The largest value of a limited quantity along a motion, and the rates that many depend on."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from freefloat.dynamics.inverse_dynamics import Forces
from freefloat.motion.extrema import Extremum, Function, at_nodes, maximum
from freefloat.motion.law import Rates
from freefloat.motion.motion import Ending, Motion
from freefloat.so3 import Array, IntArray

_DIVERGENCE = 1e3
"""Ratio of a value at a singular end to those before it, from which rounding alone bounds it."""


def place_of_maximum(motion: Motion, values: Function) -> float:
    """Panel coordinate of the maximum of a function of states, which every motion has."""
    return maximum(at_nodes(motion, values), values).u if motion.panels else 0.0


def peak(motion: Motion, values: Function, nodes: Array | None = None) -> Extremum:
    """The maximum of functions of rates; infinite where they have no bound at a singular end.

    Args:
        motion: The motion.
        values: The functions.
        nodes: Their values at the nodes of the motion, where they are known.
    """
    if not motion.panels:
        return Extremum(np.inf, 0, 0, -1.0)
    nodes = at_nodes(motion, values) if nodes is None else nodes
    if motion.ending is Ending.SINGULAR:
        *before, last = np.nan_to_num(nodes.reshape(-1, nodes.shape[2]), nan=np.inf)
        fastest = int(last.argmax())
        if last[fastest] > _DIVERGENCE * np.abs(before).max():
            return Extremum(np.inf, fastest, motion.panels - 1, 1.0)
    return maximum(nodes, values)


def largest_magnitude(
    motion: Motion, vectors: Function, nodes: Array | None = None
) -> tuple[float, float]:
    """The largest magnitude of a vector that depends on rates, and its time [s].

    Arguments as of :func:`peak`.
    """

    def squared(panel: IntArray, x: Array) -> Array:
        """Smooth also where the vector passes through zero."""
        return np.asarray((vectors(panel, x) ** 2).sum(axis=1, keepdims=True))

    squares = None if nodes is None else (nodes * nodes).sum(axis=2, keepdims=True)
    place = peak(motion, squared, squares)
    return float(np.sqrt(place.value)), motion.time_at(place.u)


def rates_along(motion: Motion) -> Callable[[IntArray, Array], Rates]:
    """The rates along a motion, by panels and their parameters."""
    law = motion.law
    return lambda panel, x: law.rates(*motion.at(panel, x), motion.timing_segment(panel))


def efforts_along(motion: Motion) -> Callable[[IntArray, Array], Forces]:
    """Rates, accelerations and forces along a motion, by panels and their parameters."""
    law = motion.law
    return lambda panel, x: law.effort(*motion.at(panel, x), motion.timing_segment(panel))
