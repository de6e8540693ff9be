"""Motions of spacecraft and arm for prescribed joints."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import chebyshev

from freefloat.dynamics.momentum import conserved_inertias
from freefloat.errors import IntegrationError
from freefloat.motion.law import JointLaw
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.panels import DEGREE, NODES
from freefloat.rotations import Rotation
from freefloat.so3 import Array, frozen, turned

_PANELS = 4
"""Panels of a motion in a span: their polynomials are exact to 1e-10."""
_POINTS = frozen(chebyshev.chebpts2(2 * DEGREE + 1))
"""Points of a panel at which the equation holds; every second one is a node of the motion."""
_INTEGRALS = frozen(
    chebyshev.chebvander(_POINTS, 2 * DEGREE + 1)
    @ chebyshev.chebint(np.linalg.inv(chebyshev.chebvander(_POINTS, 2 * DEGREE)), lbnd=-1, axis=0)
)
"""Maps values at the points to the integrals from the first point to each."""
_BY_RATE = np.zeros((4, 4, 3))
for _k in range(3):
    _i, _j = (_k + 1) % 3, (_k + 2) % 3
    _BY_RATE[3, _k, _k], _BY_RATE[_k, 3, _k] = 0.5, -0.5
    _BY_RATE[_i, _j, _k], _BY_RATE[_j, _i, _k] = -0.5, 0.5
"""Derivative of element j of a quaternion by element i and the rate about axis k, by (8c)."""
_CONVERGED, _ITERATIONS = 1e-14, 100


def integrate_spline(law: JointLaw, attitude: Array) -> Motion:
    """The motion of spacecraft and arm with prescribed joints.

    Quaternions are polynomials in each panel that satisfy (8c) at its points (collocation), found
    by Picard's iteration; what depends on the joints alone is computed for all points at once. The
    spacecraft has the attitude at the start, a unit quaternion x, y, z, w.

    Raises:
        IntegrationError: If the spacecraft turns too fast for the panels.
    """
    law.setting.model.require_supported("joint motions")
    timing, system, spline = law.timing, law.setting.system, law.curve
    panels = _PANELS * spline.spans
    half = law.duration / panels / 2.0
    times = (half * (2.0 * np.arange(panels)[:, None] + _POINTS + 1.0)).ravel()
    times[-1] = law.duration  # without rounding
    s, speed = timing.s(times), timing.s(times, 1)
    joints = spline.at(s)
    rates, momentum = spline.at(s, 1) * speed[:, None], np.array(system.momentum, dtype=float)
    D, Dq = conserved_inertias(system.model, joints)
    inverse_D = np.asarray(np.linalg.inv(D), dtype=float)
    own = -turned(inverse_D, turned(Dq, rates) + system.wheels)
    quaternions, last = [], attitude
    for panel in np.split(np.arange(len(s)), panels):
        found = _attitudes(last, half, inverse_D[panel], own[panel], momentum)
        if found is None:
            reason = "the spacecraft turns too fast"
            raise IntegrationError(float(times[panel[0]]), reason, "another duration")
        last = found[-1] / np.linalg.norm(found[-1])
        quaternions.append(found[:-1:2])
    rows = np.vstack([*quaternions, last])
    attitudes = rows / np.linalg.norm(rows, axis=1, keepdims=True)
    nodes = np.append(np.arange(len(s)).reshape(panels, -1)[:, :-1:2].ravel(), len(s) - 1)
    return Motion(law, Ending.COMPLETED, times[nodes], attitudes, joints[nodes])


def _attitudes(
    first: Array, half: float, inverse_D: Array, own: Array, momentum: Array
) -> Array | None:
    """Quaternions at the points of a panel, shape (17, 4); None without convergence.

    Args:
        first: The quaternion at its start.
        half: Half of its duration [s].
        inverse_D: Inverse of D at its points, shape (17, 3, 3).
        own: Angular velocity of the spacecraft without momentum, its axes [rad/s], shape (17, 3).
        momentum: Angular momentum, inertial axes [N m s], shape (3,).
    """
    quaternions, omega = np.tile(first, (len(own), 1)), own
    for _ in range(_ITERATIONS):
        if momentum.any():
            h = Rotation.from_quat(quaternions).inv().apply(momentum)
            omega = own + np.einsum("kij,kj->ki", inverse_D, h)
        rates = (np.tensordot(quaternions, _BY_RATE, 1) @ omega[:, :, None])[..., 0]  # (8c)
        integrated = first + half * (_INTEGRALS @ rates)
        change = np.abs(integrated - quaternions).max()
        quaternions = integrated
        if change < _CONVERGED:
            return quaternions
    return None


def node_times(law: JointLaw) -> Array:
    """Times of the nodes of a motion with prescribed joints [s]."""
    panels = _PANELS * law.curve.spans
    inner = (np.arange(panels)[:, None] + (NODES[:DEGREE] + 1.0) / 2.0) / panels
    return np.asarray(law.duration * np.append(inner.ravel(), 1.0))
