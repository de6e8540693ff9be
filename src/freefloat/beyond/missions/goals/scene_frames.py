"""The bodies of a scene along joint paths, in the spacecraft frame from its origin."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from freefloat.beyond.missions.goals.placements import Placements
from freefloat.motion.setting import Setting
from freefloat.so3 import UPRIGHT, Array, IntArray, turned

_LATER = 1e-3
"""Difference of times in velocities of the scene [s]."""


class ScenePlaces(NamedTuple):
    """Where a robot is at K instants.

    Attributes:
        times: The instants [s], shape (K,).
        attitudes: Of the spacecraft, shape (K, 3, 3).
        bodies: The robot's bodies.
    """

    times: Array
    attitudes: Array
    bodies: Placements

    def taken(self, rows: IntArray) -> ScenePlaces:
        """Some of the instants."""
        return ScenePlaces(self.times[rows], self.attitudes[rows], self.bodies.taken(rows))


class Placed(NamedTuple):
    """The S bodies of a scene at K instants.

    Attributes:
        rotations: Shape (K, S, 3, 3).
        positions: [m], shape (K, S, 3).
    """

    rotations: Array
    positions: Array


class SceneFrames:
    """The bodies of the scene of a setting.

    Attributes:
        free: Which of them do not move with the end-effector, shape (S,).
    """

    def __init__(self, setting: Setting) -> None:
        """Prepare the bodies that the end-effector holds."""
        model = setting.model
        self._setting, self._bodies = setting, setting.scene.bodies
        self.free = np.array([body.motion != "target" for body in self._bodies] or [False])
        state = UPRIGHT, np.zeros(model.dof)
        last = model.body_poses(*state)[model.dof]
        self._grip = last.inverse() @ model.end_effector_pose(*state)

    def along(self, places: ScenePlaces) -> Placed:
        """The bodies at some instants."""
        rotations, origins, _, centres, _ = places.bodies
        count, back = len(places.times), places.attitudes.transpose(0, 2, 1)
        placed = Placed(
            np.empty((count, len(self._bodies), 3, 3)), np.empty((count, len(self._bodies), 3))
        )
        for number, body in enumerate(self._bodies):
            if self.free[number]:
                pose = body.pose_at(places.times, self._setting)
                placed.rotations[:, number] = back @ pose.rotation
                placed.positions[:, number] = turned(back, pose.position) + centres
            else:
                held, last = self._grip @ body.pose, rotations[:, -1]
                placed.rotations[:, number] = last @ held.rotation
                placed.positions[:, number] = origins[:, -1] + last @ held.position
        return placed

    def velocities(self, number: int, places: ScenePlaces, points: Array) -> Array:
        """Velocities of points (K, 3) of a free body from the centre of mass [m/s]."""
        body, attitudes = self._bodies[number], places.attitudes
        if body.motion == "fixed" and not self._setting.drifts:
            return np.zeros_like(points)
        now, later = (body.pose_at(places.times + step, self._setting) for step in (0.0, _LATER))
        x = np.einsum("kij,kj->ki", attitudes, points - places.bodies.centres)
        moved = turned((later @ now.inverse()).rotation, x - now.position) + later.position
        return np.asarray(np.einsum("kij,ki->kj", attitudes, moved - x) / _LATER)
