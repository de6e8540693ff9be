"""A second integration of a motion, by an independent integrator, for comparison.

Fixed steps in time, fourth order, on the group of rotations itself (Munthe-Kaas 1998): the
attitude is advanced by the exponential of a rotation vector and needs no normalization. The main
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
"""Number of panels before a singularity that are omitted: the rates by time have no bound there."""


@dataclass(frozen=True)
class Comparison:
    """Differences between a motion and its second integration.

    Attributes:
        attitude: Largest angle between the attitudes [rad].
        attitude_time: Its time [s].
        joints: Largest difference of a joint [rad or m].
        joints_time: Its time [s].
        joint: Name of that joint.
        halving_attitude: Change of the last attitude when steps are halved [rad].
        halving_joints: Change of the last joint values [rad or m].
        steps: Number of the halved steps.
        until: Time at which the comparison ends [s].
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


def integrate_again(motion: Motion) -> Comparison:
    """Integrate a motion from its first state with steps from node to node, whole and halved.

    Args:
        motion: The motion; of one that ends singular, the last panels are omitted.
    """
    omitted = _BEFORE_SINGULAR if motion.ending is Ending.SINGULAR else 0
    panels = max(0, motion.panels - omitted)
    whole = _integrated(motion, panels, 1)
    attitudes, joints = _integrated(motion, panels, 2)
    nodes = slice(0, DEGREE * panels + 1)
    times = motion.times[nodes]
    angles = angle_between(attitudes, motion.attitudes[nodes])
    differences = np.abs(joints - motion.joints[nodes])
    node, joint = np.unravel_index(int(differences.argmax()), differences.shape)
    return Comparison(
        attitude=float(angles.max()),
        attitude_time=float(times[angles.argmax()]),
        joints=float(differences.max()),
        joints_time=float(times[node]),
        joint=motion.problem.model.joint_names[joint],
        halving_attitude=float(angle_between(attitudes[-1], whole[0][-1])),
        halving_joints=float(np.abs(joints[-1] - whole[1][-1]).max()),
        steps=2 * DEGREE * panels,
        until=float(times[-1]),
    )


def _integrated(motion: Motion, panels: int, parts: int) -> tuple[Array, Array]:
    """Attitudes (N, 4) and joints (N, n) at the nodes, with ``parts`` steps between nodes."""
    flow = _Flow(motion)
    attitude, joints = motion.attitudes[0], motion.joints[0]
    attitudes, rows = [attitude], [joints]
    for panel in range(panels):
        nodes = motion.times[DEGREE * panel : DEGREE * (panel + 1) + 1]
        flow.segment = motion.timing_segment(panel)
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
        self.segment = 0

    def step(self, t: float, h: float, attitude: Array, joints: Array) -> tuple[Array, Array]:
        """Attitude and joints after a step."""
        none = np.zeros(3)
        w1, r1 = self._rates(t, attitude, none, joints)
        w2, r2 = self._rates(t + h / 2.0, attitude, h / 2.0 * w1, joints + h / 2.0 * r1)
        w3, r3 = self._rates(t + h / 2.0, attitude, h / 2.0 * w2, joints + h / 2.0 * r2)
        w4, r4 = self._rates(t + h, attitude, h * w3, joints + h * r3)
        vector = h / 6.0 * (w1 + 2.0 * w2 + 2.0 * w3 + w4)
        return _rotated(attitude, vector), joints + h / 6.0 * (r1 + 2.0 * r2 + 2.0 * r3 + r4)

    def _rates(
        self, t: float, attitude: Array, vector: Array, joints: Array
    ) -> tuple[Array, Array]:
        """Rates of the rotation vector (the inverse of the exponential's derivative) and joints."""
        task = self._path.twist_and_speed(t, self.segment)
        omega, rates = self._equation.rates(_rotated(attitude, vector), joints, *task)
        first = cross(vector, omega)
        return omega + first / 2.0 + cross(vector, first) / 12.0, rates


def _rotated(attitude: Array, vector: Array) -> Array:
    """An attitude rotated about spacecraft axes by a rotation vector [rad]."""
    angle = float(np.sqrt(vector @ vector))
    p, q, r = (np.sinc(angle / (2.0 * np.pi)) / 2.0 * vector).tolist()
    s = float(np.cos(angle / 2.0))
    x, y, z, w = attitude.tolist()
    return np.array([
        w * p + x * s + y * r - z * q,
        w * q - x * r + y * s + z * p,
        w * r + x * q - y * p + z * s,
        w * s - x * p - y * q - z * r,
    ])  # fmt: skip
