"""A motion followed a second time, by another integrator than the one that made it.

Fixed steps in time, fourth order, on the group of rotations itself (Munthe-Kaas 1998): the
attitude is advanced by the exponential of a rotation vector and needs no normalization. The first
integrator takes adaptive steps of eighth order along the arc length, in quaternions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freefloat.motion.motion import Ending, Motion
from freefloat.motion.panels import DEGREE
from freefloat.so3 import Array, angle_between, cross

NAME = "Munthe-Kaas Runge-Kutta of fourth order on SO(3), fixed steps in time"
_BEFORE_SINGULAR = 2
"""Panels before a singularity that are left out: there the rates by time grow beyond all bounds."""


@dataclass(frozen=True)
class Comparison:
    """A motion beside itself, followed again from its first state.

    Attributes:
        attitude: Largest angle between the two [rad].
        attitude_time: When [s].
        joints: Largest difference of a joint [rad or m].
        joints_time: When [s].
        joint: Which one.
        halving_attitude: By how much the last attitude changes when steps are halved [rad].
        halving_joints: Likewise the last joints [rad or m].
        steps: Number of the shorter steps.
        until: Time up to which it was followed [s].
    """

    attitude: float
    attitude_time: float
    joints: float
    joints_time: float
    joint: str
    halving_attitude: float
    halving_joints: float
    steps: int
    until: float


def follow_again(motion: Motion) -> Comparison:
    """Follow a motion from its first state, twice, with steps from node to node and half of them.

    Args:
        motion: The motion; before a singular end it is followed up to the last panels.
    """
    left_out = _BEFORE_SINGULAR if motion.ending is Ending.SINGULAR else 0
    panels = max(0, motion.panels - left_out)
    whole = _followed(motion, panels, 1)
    attitudes, joints = _followed(motion, panels, 2)
    known = slice(0, DEGREE * panels + 1)
    times = motion.times[known]
    turns = angle_between(attitudes, motion.attitudes[known])
    gaps = np.abs(joints - motion.joints[known])
    node, joint = np.unravel_index(int(gaps.argmax()), gaps.shape)
    return Comparison(
        attitude=float(turns.max()),
        attitude_time=float(times[turns.argmax()]),
        joints=float(gaps.max()),
        joints_time=float(times[node]),
        joint=motion.problem.model.joint_names[joint],
        halving_attitude=float(angle_between(attitudes[-1], whole[0][-1])),
        halving_joints=float(np.abs(joints[-1] - whole[1][-1]).max()),
        steps=2 * DEGREE * panels,
        until=float(times[-1]),
    )


def _followed(motion: Motion, panels: int, parts: int) -> tuple[Array, Array]:
    """Attitudes (N, 4) and joints (N, n) at the nodes of panels, each interval cut into parts."""
    timing = motion.problem.path.timing
    flow = _Flow(motion)
    attitude, joints = motion.attitudes[0], motion.joints[0]
    attitudes, rows = [attitude], [joints]
    for panel in range(panels):
        nodes = motion.times[DEGREE * panel : DEGREE * (panel + 1) + 1]
        flow.piece = timing.segment_at(float(nodes.mean()))
        for start, end in zip(nodes[:-1].tolist(), nodes[1:].tolist(), strict=True):
            h = (end - start) / parts
            for part in range(parts):
                attitude, joints = flow.step(start + part * h, h, attitude, joints)
            attitudes.append(attitude)
            rows.append(joints)
    return np.array(attitudes), np.array(rows)


class _Flow:
    """Steps of (8) in time."""

    def __init__(self, motion: Motion) -> None:
        self._path = motion.problem.path
        self._equation = motion.problem.resolved_rate_solver()
        self.piece = 0

    def step(self, t: float, h: float, attitude: Array, joints: Array) -> tuple[Array, Array]:
        """Attitude and joints a step later."""
        still = np.zeros(3)
        w1, r1 = self._rates(t, attitude, still, joints)
        w2, r2 = self._rates(t + h / 2.0, attitude, h / 2.0 * w1, joints + h / 2.0 * r1)
        w3, r3 = self._rates(t + h / 2.0, attitude, h / 2.0 * w2, joints + h / 2.0 * r2)
        w4, r4 = self._rates(t + h, attitude, h * w3, joints + h * r3)
        turn = h / 6.0 * (w1 + 2.0 * w2 + 2.0 * w3 + w4)
        return _turned(attitude, turn), joints + h / 6.0 * (r1 + 2.0 * r2 + 2.0 * r3 + r4)

    def _rates(self, t: float, attitude: Array, turn: Array, joints: Array) -> tuple[Array, Array]:
        """Rates of the rotation vector (the inverse of the exponential's derivative) and joints."""
        wish = self._path.twist_and_speed(t, self.piece)
        omega, rates = self._equation.rates(_turned(attitude, turn), joints, *wish)
        bent = cross(turn, omega)
        return omega + bent / 2.0 + cross(turn, bent) / 12.0, rates


def _turned(attitude: Array, turn: Array) -> Array:
    """An attitude turned further about spacecraft axes by a rotation vector [rad]."""
    angle = float(np.sqrt(turn @ turn))
    p, q, r = (np.sinc(angle / (2.0 * np.pi)) / 2.0 * turn).tolist()
    s = float(np.cos(angle / 2.0))
    x, y, z, w = attitude.tolist()
    return np.array([
        w * p + x * s + y * r - z * q,
        w * q - x * r + y * s + z * p,
        w * r + x * q - y * p + z * s,
        w * s - x * p - y * q - z * r,
    ])  # fmt: skip
