"""The in-plane factor S(q2, q3) (40) of det A for an elbow arm under a spherical wrist.

With the wrist eliminated and the end-effector not rotating, shoulder and elbow satisfy the 6x6
system (37). In the axes of the arm's plane it splits into two blocks as in (39): momentum about the
plane's normal and velocities in the plane on one side, the rest on the other. The determinant of
the former is the factor.
"""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.momentum import Task, system_matrix
from freefloat.dynamics.virtual_manipulator import VirtualManipulator, meeting_point
from freefloat.errors import InputError
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, low_discrepancy

_WRIST = (0.0, np.pi / 2, 0.0)
"""Wrist angles for evaluating (37), which does not depend on them: far from singular."""
_IN_PLANE, _OUT_OF_PLANE = [0, 4, 5], [1, 2, 3]
_TOLERANCE = 1e-6


def in_plane_determinant(model: FreeFloatingModel, axes: Array, joints: Array) -> float:
    """The factor S(q2, q3) at joints (6,), which by (39) does not depend on the first joint.

    Args:
        model: Robot.
        axes: As returned by :func:`plane_axes`.
        joints: Joint values [rad], shape (6,).
    """
    R = _shoulder_system(model, np.array([0.0, joints[1], joints[2], *_WRIST]), axes)
    return _in_plane_block(R)


def plane_axes(model: FreeFloatingModel, task: Task) -> Array:
    """Axes of the arm's plane at q1 = 0: its normal and two in it, rows of shape (3, 3).

    The bodies behind the wrist move with its velocity v and contribute m d x v to the momentum, d
    from the wrist centre to their centre of mass. Where d leaves the plane that term couples the
    blocks; it is a multiple of other rows and is subtracted before the coupling is tested.

    Raises:
        InputError: If the system of the arm does not split into the two blocks.
    """
    error = InputError(
        "margin.measure",
        "this arm's system (5) has no in-plane factor",
        "gjm, system or sigma; arm wants six joints, the second and third parallel and normal to "
        "the first, the last three meeting in a point, and a spacecraft symmetric about the first",
    )
    virtual = VirtualManipulator.of(model)
    if task is not Task.POSE or not virtual.has_elbow_and_spherical_wrist:
        raise error
    offset = _last_body_offset(model, virtual.reach)
    if offset is None:
        raise error
    reference = _plane_axes_at(virtual, np.zeros(6))
    for fraction in low_discrepancy(8, 6):
        joints = np.pi * (2.0 * fraction - 1.0)
        joints[4] = 0.5 + 2.0 * fraction[4]
        axes = _plane_axes_at(virtual, joints)
        R = _shoulder_system(model, joints, axes)
        d = axes @ virtual.pose(joints).rotation @ virtual.tool.T @ offset
        R[:3] -= model.bodies[-1].mass * np.cross(d, R[3:].T).T
        blocks = R[np.ix_(_IN_PLANE, _OUT_OF_PLANE)], R[np.ix_(_OUT_OF_PLANE, _IN_PLANE)]
        coupling, scale = np.abs(blocks).max(), np.abs(R).max()
        change = abs(_in_plane_block(R) - in_plane_determinant(model, reference, joints))
        if max(abs(axes[0] @ axes[2]), coupling / scale, change / scale**3) > _TOLERANCE:
            raise error
    return reference


def _in_plane_block(R: Array) -> float:
    return float(np.linalg.det(R[np.ix_(_IN_PLANE, _IN_PLANE)]))


def _shoulder_system(model: FreeFloatingModel, joints: Array, axes: Array) -> Array:
    """The 6x6 system (37) of shoulder and elbow, wrist eliminated, end-effector not rotating.

    Args:
        model: Robot.
        joints: Shape (6,).
        axes: Axes in which the system is written, rows in the spacecraft frame, shape (3, 3).

    Returns:
        Rows ``h, v`` and columns ``w, q1 q2 q3``.
    """
    A = system_matrix(model, joints)
    R = A[:6, :6] - A[:6, 6:] @ np.linalg.solve(A[6:, 6:], A[6:, :6])
    R[:3], R[3:] = axes @ R[:3], axes @ R[3:]
    R[:, :3] = R[:, :3] @ axes.T
    return R


def _plane_axes_at(virtual: VirtualManipulator, joints: Array) -> Array:
    """Normal of the arm's plane (joint 2), joint 1 x joint 2, joint 1: rows, shape (3, 3)."""
    k, normal = virtual.axes_at(joints)[:2]
    return np.array([normal, np.cross(k, normal), k])


def _last_body_offset(model: FreeFloatingModel, reach: float) -> Array | None:
    """Vector from the real arm's wrist centre to the last body's centre of mass, in that body."""
    _, five, six = model.bodies[4:]
    R = five.placement.rotation @ six.placement.rotation
    origin = five.placement.position + five.placement.rotation @ six.placement.position
    points = np.array([np.zeros(3), five.placement.position, origin])
    axes = np.array([model.bodies[4].axis, five.placement.rotation @ five.axis, R @ six.axis])
    centre = meeting_point(points, axes, 1e-9 * reach)
    return None if centre is None else six.centre - R.T @ (centre - origin)
