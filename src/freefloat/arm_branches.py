"""All arm configurations that reach a pose at a given spacecraft attitude.

Closed forms for planar elbow arms and for elbow arms with a spherical wrist, from three elementary
problems about one rotation; Newton's method from many starts for every other arm. An arm with more
joints than the task needs has infinitely many: it gets a spread-out, reproducible set.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.dynamics import Task
from freefloat.model import FreeFloatingModel
from freefloat.spatial import Array, Pose, frozen, low_discrepancy
from freefloat.virtual_manipulator import VirtualManipulator

_STARTS = 256
_ITERATIONS = 60
_MET = 1e-9
"""A pose is met when position and attitude are off by less than this [m, rad]."""
_EXACT = 1e-13
_NEARLY_SQUARE = 1e-6
"""Cosine below which axes count as normal to each other: written with rounded angles."""
_SAME = 1e-5
"""Configurations nearer than this in every joint are one [rad, m]."""
_REDUNDANT_SET = 16
_SIGNS = ((1.0, "+"), (-1.0, "-"))


@dataclass(frozen=True, eq=False)
class ArmBranch:
    """One arm configuration that reaches a pose.

    Attributes:
        index: Its number; with a closed form the same sign pattern keeps the same number at every
            attitude.
        label: What tells it apart, e.g. ``"shoulder+ elbow- wrist+"``; the number otherwise.
        joints: Joint values, turning joints within their URDF range where that is possible, else
            in (-pi, pi], shape (n,).
    """

    index: int
    label: str
    joints: Array


def arm_branches(model: FreeFloatingModel, target: Pose, task: Task) -> tuple[ArmBranch, ...]:
    """Every arm configuration that puts the end-effector at a pose.

    Args:
        model: Robot.
        target: End-effector pose from the system's centre of mass, in the spacecraft's frame.
        task: Which part of the pose counts.

    Returns:
        The branches; none where the pose is out of reach. Joint ranges are not enforced.
    """
    virtual = VirtualManipulator.of(model)
    if task is Task.POSE and virtual.has_elbow_and_spherical_wrist:
        found = list(_elbow_with_wrist(virtual, target))
    elif task.planar and len(task.rows) == model.dof and not virtual.prismatic.any():
        found = list(_planar_elbow(virtual, target))
    else:
        found = list(enumerate_numeric(virtual, model, target, task))
    polished = [(i, label, _polished(virtual, target, task, joints)) for i, label, joints in found]
    return tuple(
        ArmBranch(index, label, frozen(_in_range(model, joints)))
        for index, label, joints in polished
        if np.abs(_errors(virtual, target, task, joints[None])).max() < _MET
    )


def _polished(virtual: VirtualManipulator, target: Pose, task: Task, joints: Array) -> Array:
    """Newton steps: near a straight wrist or elbow the closed forms lose half the digits."""
    for _ in range(2):
        error = _errors(virtual, target, task, joints[None])[0]
        if np.abs(error).max() < _EXACT:
            break
        J = virtual.jacobian(joints[None])[0, task.rows]
        joints = joints + np.linalg.lstsq(J, error, rcond=1e-6)[0]
    return joints


def nearest_configuration(
    model: FreeFloatingModel, target: Pose, task: Task, joints: Array
) -> list[ArmBranch]:
    """The configuration that Newton's method reaches from given joints: one, or none.

    For arms with more joints than the task needs, whose configurations are a continuum.
    """
    virtual = VirtualManipulator.of(model)
    q = _newton(virtual, target, task, joints[None])
    if np.abs(_errors(virtual, target, task, q)).max() > _MET:
        return []
    return [ArmBranch(_REDUNDANT_SET, "given", frozen(q[0]))]


def _in_range(model: FreeFloatingModel, joints: Array) -> Array:
    """Turn joints by whole turns into their range, as near to zero as that allows."""
    values = joints.copy()
    for i, body in enumerate(model.bodies[1:]):
        if body.prismatic:
            continue
        nearest = -((-values[i] + np.pi) % (2.0 * np.pi) - np.pi)
        turns = sorted((nearest + 2.0 * np.pi * k for k in (-1, 0, 1)), key=abs)
        inside = [value for value in turns if body.lower <= value <= body.upper]
        values[i] = inside[0] if inside else nearest
    return values


def _rotate(axis: Array, angle: float) -> Array:
    return np.asarray(Rotation.from_rotvec(angle * axis).as_matrix())


def _angle_onto(axis: Array, start: Array, end: Array) -> float:
    """The angle about an axis that brings one vector's direction onto another's."""
    a, b = start - axis * (axis @ start), end - axis * (axis @ end)
    return float(np.arctan2(axis @ np.cross(a, b), a @ b))


def _angle_to_height(axis: Array, vector: Array, along: Array, height: float, sign: float) -> float:
    """One of the two angles with ``along @ rotated(vector) == height``; nan where there is none."""
    level = (axis @ along) * (axis @ vector)
    cosine, sine = along @ vector - level, along @ np.cross(axis, vector)
    amplitude = np.hypot(cosine, sine)
    if amplitude < 1e-14:
        return 0.0
    share = (height - level) / amplitude
    if abs(share) > 1.0 + 1e-9:
        return float("nan")
    return float(np.arctan2(sine, cosine) + sign * np.arccos(np.clip(share, -1.0, 1.0)))


def _bend(wrist: Array, roll: Array, sign: float) -> float:
    """The wrist's middle angle that takes its last axis to ``roll``; nan where there is none.

    Where the middle axis is normal to the others, by the angle between those: that keeps all digits
    near a straight wrist.
    """
    h4, h5, h6 = wrist
    if max(abs(h4 @ h5), abs(h5 @ h6)) > _NEARLY_SQUARE:
        return _angle_to_height(h5, h6, h4, h4 @ roll, sign)
    angle = np.arctan2(np.linalg.norm(np.cross(h4, roll)), h4 @ roll)
    return float(sign * angle - _angle_onto(h5, h4, h6))


def _elbow_with_wrist(
    virtual: VirtualManipulator, target: Pose
) -> Iterator[tuple[int, str, Array]]:
    """Eight branches: shoulder from (17), elbow from (28), then the spherical wrist.

    ``P`` and ``h`` are positions and axes of the virtual joints at zero, ``w`` the wrist centre.
    """
    p, R0, points, axes = virtual.kinematics(np.zeros(6))
    P, h, w = points[:, 0], axes[:, 0], virtual.wrist_centre
    turned = target.rotation @ R0[0].T
    u = target.position - turned @ (p[0] - w) - P[0]
    upper, fore = P[2] - P[1], w - P[2]
    for number, signs in enumerate(product(_SIGNS, repeat=3)):
        (shoulder, a), (elbow, b), (bend, c) = signs
        q1 = -_angle_to_height(h[0], u, h[1], h[1] @ (w - P[0]), shoulder)
        v = _rotate(h[0], -q1) @ u - (P[1] - P[0])
        q3 = _angle_to_height(h[2], fore, upper, (v @ v - upper @ upper - fore @ fore) / 2, elbow)
        if np.isnan(q1 + q3):
            continue
        q2 = _angle_onto(h[1], upper + _rotate(h[2], q3) @ fore, v)
        hand = (_rotate(h[0], q1) @ _rotate(h[1], q2) @ _rotate(h[2], q3)).T @ turned
        q5 = _bend(h[3:], hand @ h[5], bend)
        if np.isnan(q5):
            continue
        bent = _rotate(h[4], q5)
        straight = np.linalg.norm(np.cross(h[3], bent @ h[5])) < 1e-12
        q4 = 0.0 if straight else _angle_onto(h[3], bent @ h[5], hand @ h[5])
        rest = (_rotate(h[3], q4) @ bent).T @ hand
        q6 = _angle_onto(h[5], h[4], rest @ h[4])
        yield number, f"shoulder{a} elbow{b} wrist{c}", np.array([q1, q2, q3, q4, q5, q6])


def _planar_elbow(virtual: VirtualManipulator, target: Pose) -> Iterator[tuple[int, str, Array]]:
    """Two branches: the triangle of b and c under the paper's point 3 (20), (28)."""
    p, R0, points, axes = virtual.kinematics(np.zeros(len(virtual.axes)))
    P, h = points[:, 0], axes[:, 0]
    turned = target.rotation @ R0[0].T
    last = P[2] if len(P) == 3 else p[0]
    tip = turned @ (p[0] - P[2]) if len(P) == 3 else np.zeros(3)
    flat = np.array([1.0, 1.0, 0.0])  # heights do not count
    v, b, c = flat * (target.position - tip - P[0]), flat * (P[1] - P[0]), flat * (last - P[1])
    for number, (sign, a) in enumerate(_SIGNS):
        q2 = _angle_to_height(h[1], c, b, (v @ v - b @ b - c @ c) / 2, sign)
        if np.isnan(q2):
            continue
        q1 = _angle_onto(h[0], b + _rotate(h[1], q2) @ c, v)
        joints = [q1, q2]
        if len(P) == 3:
            folded = _rotate(h[0], q1) @ _rotate(h[1], q2)
            x = np.array([1.0, 0.0, 0.0])
            joints.append(_angle_onto(h[2], x, folded.T @ turned @ x))
        yield number, f"elbow{a}", np.array(joints)


def enumerate_numeric(
    virtual: VirtualManipulator, model: FreeFloatingModel, target: Pose, task: Task
) -> Iterator[tuple[int, str, Array]]:
    """Newton's method from many starts: all solutions, or a spread of them for redundant arms."""
    arm = model.bodies[1:]
    lower = np.array([b.lower if b.prismatic else -np.pi for b in arm])
    upper = np.array([b.upper if b.prismatic else np.pi for b in arm])
    q = lower + (upper - lower) * low_discrepancy(_STARTS, len(arm))
    q = _newton(virtual, target, task, q)
    met = np.abs(_errors(virtual, target, task, q)).max(axis=1) < _MET
    q = np.where(virtual.prismatic, q, np.arctan2(np.sin(q), np.cos(q)))[met]
    q = q[np.lexsort(np.round(q, 6).T[::-1])]
    kept = _spread(q) if len(arm) > len(task.rows) else _distinct(q)
    for number, joints in enumerate(kept):
        yield number, str(number), joints


def _errors(virtual: VirtualManipulator, target: Pose, task: Task, q: Array) -> Array:
    """What is missing to the target, shape (K, m): a twist in the spacecraft frame."""
    p, R, _, _ = virtual.kinematics(q)
    turn = Rotation.from_matrix(target.rotation @ R.transpose(0, 2, 1)).as_rotvec()
    return np.hstack([target.position - p, turn])[:, task.rows]


def _newton(virtual: VirtualManipulator, target: Pose, task: Task, q: Array) -> Array:
    """Levenberg's damped Newton steps, all starts at once; damping fades with the error."""
    for _ in range(_ITERATIONS):
        e = _errors(virtual, target, task, q)
        J = virtual.jacobian(q)[:, task.rows]
        Jt = J.transpose(0, 2, 1)
        damping = 1e-2 * np.minimum(1.0, (e * e).sum(axis=1))[:, None, None] + 1e-14
        step = Jt @ np.linalg.solve(J @ Jt + damping * np.eye(len(task.rows)), e[:, :, None])
        size = np.abs(step[:, :, 0]).max(axis=1, keepdims=True)
        q = q + step[:, :, 0] / np.maximum(1.0, size)
        if np.abs(e).max() < 1e-12:
            break
    return q


def _gap(a: Array, b: Array) -> Array:
    """Largest joint difference, whole turns not counted; sliding joints are short of them."""
    return np.asarray(np.abs((a - b + np.pi) % (2.0 * np.pi) - np.pi).max(axis=-1))


def _distinct(q: Array) -> list[Array]:
    kept: list[Array] = []
    for joints in q:
        if all(_gap(joints, other) > _SAME for other in kept):
            kept.append(joints)
    return kept


def _spread(q: Array) -> list[Array]:
    """The first, then always the one farthest from those kept."""
    if not len(q):
        return []
    kept, distance = [q[0]], _gap(q, q[0])
    while len(kept) < min(_REDUNDANT_SET, len(q)) and distance.max() > _SAME:
        kept.append(q[int(np.argmax(distance))])
        distance = np.minimum(distance, _gap(q, kept[-1]))
    return kept
