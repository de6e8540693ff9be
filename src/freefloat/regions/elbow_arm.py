"""Elbow arms reduced to a plane, and the reach of any arm."""

from __future__ import annotations

import numpy as np

from freefloat.attitude_grids import low_discrepancy
from freefloat.dynamics.measures import plane_axes, singularity_measure
from freefloat.dynamics.tasks import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError
from freefloat.regions.planar_regions import Complex, PlanarArm, point_3, two_angles
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array

_GRID = 8
"""Angles per joint; S is a trigonometric polynomial of degree two, which fewer determine."""


def elbow_arm(model: FreeFloatingModel) -> PlanarArm:
    """The planar arm of two joints, q2 and q3, whose S is the ``arm`` measure (40) of an elbow arm.

    It lies in the plane that the first joint rotates, x across that joint and y along it. Its point
    3 is the wrist centre of the virtual manipulator, at the same distance from the centre of mass.
    Its inertia is one that gives this S and has no other meaning.

    Raises:
        InputError: For arms without that measure, see
            :func:`~freefloat.dynamics.measures.singularity_measure`.
    """
    axes = plane_axes(model, Task.POSE)
    virtual = VirtualManipulator.of(model)
    _, _, points, joint_axes = virtual.kinematics(np.zeros(6))
    corners = [points[1, 0], points[2, 0], _wrist(virtual)]
    links = np.diff([0.0, *(complex(axes[1] @ p, axes[2] @ p) for p in corners)])
    signs = np.sign(joint_axes[1:3, 0] @ axes[0])
    arm = PlanarArm(links, _inertia(model, links, signs), signs)
    joints = np.pi * (2.0 * low_discrepancy(64, 6) - 1.0)
    positions, rotations, _, _ = virtual.kinematics(joints)
    distances = np.linalg.norm(positions + rotations @ wrist_in_tool(virtual), axis=1)
    if np.abs(np.abs(point_3(arm, joints[:, 1:3])) - distances).max() > 1e-9 * virtual.reach:
        raise InputError(
            "margin.measure", "the first joint changes the wrist's distance from the mass centre",
            "a first joint whose axis passes through the virtual manipulator's base",
        )  # fmt: skip
    return arm


def wrist_in_tool(virtual: VirtualManipulator) -> Array:
    """The virtual manipulator's wrist centre in the end-effector's frame [m], shape (3,)."""
    zero = virtual.pose(np.zeros(6))
    return np.asarray(zero.rotation.T @ (_wrist(virtual) - zero.position))


def _wrist(virtual: VirtualManipulator) -> Array:
    if virtual.wrist_centre is None:
        raise InputError("task", "the wrist is not spherical", "last three axes through one point")
    return virtual.wrist_centre


def _inertia(model: FreeFloatingModel, links: Complex, signs: Array) -> Complex:
    """The inertia, in which S is linear, by least squares on a grid; the fit must be exact."""
    measure = singularity_measure(model, Task.POSE, "arm")
    axis = 2.0 * np.pi * np.arange(_GRID) / _GRID
    joints = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    S = np.array([measure(np.array([0.0, q2, q3, 0.0, 0.0, 0.0])) for q2, q3 in joints.tolist()])
    units = _hermitian_units()
    arms = [PlanarArm(links, unit, signs) for unit in units]
    matrix = np.stack([arm.determinant(two_angles(arm, joints)) for arm in arms], axis=1)
    coefficients = np.linalg.lstsq(matrix, S, rcond=None)[0]
    if np.abs(matrix @ coefficients - S).max() > 1e-9 * np.abs(S).max():
        raise InputError(
            "margin.measure", "this arm's S(q2, q3) is not that of an arm in a plane",
            "an elbow arm with a spherical wrist",
        )  # fmt: skip
    return np.asarray(np.einsum("k,kij->ij", coefficients, units))


def _hermitian_units() -> Complex:
    """A basis of the Hermitian matrices, shape (9, 3, 3)."""
    units = []
    for i, j in zip(*np.triu_indices(3), strict=True):
        for factor in (1.0,) if i == j else (1.0, 1.0j):
            unit = np.zeros((3, 3), dtype=complex)
            unit[i, j], unit[j, i] = factor, np.conj(factor)
            units.append(unit)
    return np.array(units)
