"""States of many motions at common instants, on panels as precise motions have them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.polynomial import chebyshev

from freefloat.ensemble.endings import COMPLETED
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ensemble.systems import ScaledMotions
from freefloat.motion.panels import DEGREE, NODES, TO_COEFFICIENTS
from freefloat.so3 import Array, BoolArray

_TOLERANCE = 1e-9
_SLOPES = chebyshev.chebvander(NODES, DEGREE - 1) @ chebyshev.chebder(TO_COEFFICIENTS)
"""Maps values at the nodes of a panel to derivatives by its parameter there, shape (9, 9)."""


@dataclass(frozen=True, eq=False)
class RecordedMotions:
    """Motions that stand for disturbed ones, at the nodes of P panels of 9.

    Attributes:
        disturbed: The motions.
        times: Times of the nodes [s], shape (8 P + 1,).
        attitudes: Attitudes of the spacecraft there, shape (K, 8 P + 1, 4).
        joints: Joint values there, shape (K, 8 P + 1, n).
        completed: Which motions reach the last node, shape (K,); others are constant from the last
            node that they reach on.
    """

    disturbed: ScaledMotions = field(repr=False)
    times: Array = field(repr=False)
    attitudes: Array = field(repr=False)
    joints: Array = field(repr=False)
    completed: BoolArray = field(repr=False)

    @classmethod
    def of(
        cls, disturbed: ScaledMotions, attitudes: Array, joints: Array, panels: int, threads: int
    ) -> RecordedMotions:
        """Integrate motions from node to node.

        Args:
            disturbed: The motions.
            attitudes: Initial attitudes, shape (K, 4).
            joints: Initial joint values, shape (K, n).
            panels: Least number of panels; every segment of the time law has its own.
            threads: Number of threads.
        """
        problem, count = disturbed.problem, len(joints)
        times = _nodes(np.append(problem.path.breaks, problem.path.duration), panels)
        integrator = EnsembleIntegrator(problem, threads, tolerance=_TOLERANCE)
        states = [(attitudes, joints)]
        completed = np.ones(count, dtype=bool)
        for start, end in zip(times[:-1].tolist(), times[1:].tolist(), strict=True):
            before = states[-1]
            found = integrator.integrate(
                *before, disturbed.systems, starts=np.full(count, start), ends=np.full(count, end)
            )
            completed &= found.endings == COMPLETED
            reached = completed[:, None]
            after = zip((found.attitudes, found.joints), before, strict=True)
            q, joint_values = (np.where(reached, new, old) for new, old in after)
            states.append((q, joint_values))
        q, joint_values = (np.stack(values, axis=1) for values in zip(*states, strict=True))
        return cls(disturbed, times, q, joint_values, completed)

    @property
    def panel_times(self) -> Array:
        """Times of the nodes of each panel along the disturbed motions [s], shape (K, P, 9)."""
        return (
            self.disturbed.stretches[:, None, None] * in_panels(self.times[None, :, None])[..., 0]
        )

    def rates(self, values: Array) -> Array:
        """Derivatives by time, along the disturbed motions, of values (K, P, 9, c) in panels."""
        lengths = np.ptp(self.panel_times, axis=2)
        return np.asarray(_SLOPES @ values * (2.0 / lengths)[..., None, None])


def in_panels(values: Array) -> Array:
    """Values at nodes (K, 8 P + 1, c) by panel, neighbours of which share a node, (K, P, 9, c)."""
    nodes = np.arange(0, values.shape[1] - 1, DEGREE)[:, None] + np.arange(DEGREE + 1)
    return np.asarray(values[:, nodes])


def _nodes(ends: Array, panels: int) -> Array:
    """Times of the nodes of at least so many panels of segments that end at some times."""
    edges = [np.zeros(1)]
    for start, end in zip([0.0, *ends[:-1]], ends, strict=True):
        number = max(1, int(np.ceil(panels * (end - start) / ends[-1])))
        edges.append(np.linspace(start, end, number + 1)[1:])
    every = np.concatenate(edges)
    inside = (NODES[1:] + 1.0) / 2.0
    return np.append(0.0, (every[:-1, None] + np.diff(every)[:, None] * inside).ravel())
