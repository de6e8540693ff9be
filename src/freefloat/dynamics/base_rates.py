"""Angular velocity of the spacecraft for prescribed joint rates, in many configurations at once."""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.system import System
from freefloat.robot.model import FreeFloatingModel
from freefloat.rotations import Rotation
from freefloat.so3 import Array


def base_rates(system: System, attitudes: Array, joints: Array, rates: Array) -> Array:
    """Angular velocity of the spacecraft, ``D^-1 (R0^T h - h_w - Dq q')``, (3) of the paper.

    Args:
        system: Robot and momenta.
        attitudes: Unit quaternions x, y, z, w, shape (..., 4).
        joints: Joint values [rad or m], shape (..., n).
        rates: Joint rates, of the same shape.

    Returns:
        In the spacecraft frame [rad/s], shape (..., 3).

    Example:
        >>> system = ff.System(ff.FreeFloatingModel.from_urdf("planar_2dof"))
        >>> attitude, joints, rates = map(np.array, ([0, 0, 0, 1], [0.3, 0.7], [1.0, 0.0]))
        >>> base_rates(system, attitude, joints, rates).round(4)
        array([ 0.    ,  0.    , -0.4657])
    """
    D, carried = inertia_and_momentum(system.model, joints, rates)
    turned = Rotation.from_quat(attitudes.reshape(-1, 4))
    h = turned.inv().apply(np.array(system.momentum)).reshape(carried.shape)
    return np.asarray(np.linalg.solve(D, (h - system.wheels - carried)[..., None])[..., 0])


def inertia_and_momentum(
    model: FreeFloatingModel, joints: Array, rates: Array
) -> tuple[Array, Array]:
    """``D`` and ``Dq q'`` of (1), in many configurations at once.

    ``Dq q'`` is the angular momentum about the centre of mass while the spacecraft is fixed, so one
    pass over the bodies gives both. See :func:`freefloat.dynamics.momentum.inertia_matrices` for
    the matrices of one configuration.

    Args:
        model: Robot.
        joints: Joint values [rad or m], shape (..., n).
        rates: Joint rates, of the same shape.

    Returns:
        In spacecraft axes [kg m², N m s], shapes (..., 3, 3) and (..., 3).
    """
    base, *arm = model.bodies
    zeros = np.zeros((*joints.shape[:-1], 3))
    rotation, origin = zeros[..., None] + np.eye(3), zeros
    spin, velocity = zeros, zeros  # of the frame, at its origin
    mass, centre, speed = [base.mass], [zeros + base.centre], [zeros]
    inertia, momentum = zeros[..., None] + base.inertia, zeros
    for k, body in enumerate(arm):
        angle, rate = joints[..., k], rates[..., k, None]
        axis = rotation @ body.placement.rotation @ body.axis
        step = rotation @ body.placement.position
        rotation = rotation @ body.placement.rotation
        if body.prismatic:
            step = step + angle[..., None] * axis
        origin, velocity = origin + step, velocity + _cross(spin, step)
        if body.prismatic:
            velocity = velocity + rate * axis
        else:
            rotation = rotation @ _about(body.axis, angle)
            spin = spin + rate * axis
        offset = rotation @ body.centre
        mass.append(body.mass)
        centre.append(origin + offset)
        speed.append(velocity + _cross(spin, offset))
        turned = rotation @ body.inertia @ np.swapaxes(rotation, -1, -2)
        inertia = inertia + turned
        momentum = momentum + np.einsum("...ij,...j->...i", turned, spin)
    masses, r = np.array(mass), np.array(centre)
    r = r - np.tensordot(masses, r, 1) / masses.sum()
    weighted = masses.reshape(-1, *[1] * joints.ndim) * r
    spread = np.einsum("b...i,b...j->...ij", weighted, r)
    trace = np.trace(spread, axis1=-2, axis2=-1)[..., None, None]
    D = inertia + trace * np.eye(3) - spread
    return D, momentum + _cross(weighted, np.array(speed)).sum(axis=0)


def _cross(a: Array, b: Array) -> Array:
    """The cross product, without the overhead of ``np.cross``."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    u, v, w = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def _about(axis: Array, angles: Array) -> Array:
    """Rotations about an axis by angles (...), shape (..., 3, 3); Rodrigues' formula."""
    K = np.cross(np.eye(3), axis)
    sine, versine = np.sin(angles)[..., None, None], (1.0 - np.cos(angles))[..., None, None]
    return np.asarray(np.eye(3) + sine * K + versine * (K @ K))
