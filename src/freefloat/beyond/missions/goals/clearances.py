"""Clearances along joint paths: distances that are too small, with their derivatives.

Spheres around the shapes leave out pairs that are far apart. The distance of the others grows
along the direction between their nearest points, which move with their bodies.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from freefloat.beyond.missions.goals.attitude_kernel import JointCourse
from freefloat.beyond.missions.goals.joint_paths import JointPaths
from freefloat.beyond.missions.goals.placements import PlacedArm, Placements
from freefloat.beyond.missions.goals.violations import GoalViolations
from freefloat.limits.kinds.clearance import ClearanceLimit
from freefloat.limits.result import LimitResult
from freefloat.motion.setting import Setting
from freefloat.so3 import UPRIGHT, Array, IntArray, turned

if TYPE_CHECKING:
    from freefloat.limits.pairs import CollisionPairs

_LATER = 1e-3
"""Difference of times in velocities of the scene [s]."""
_MARGIN = 2e-3
"""Margin for the instants between those that are looked at [m]."""
_SCALE = 0.02
"""Lack of distance that counts as one [m]."""
_DEEPEST = 0.15
"""Largest lack that counts: deeper penetrations are only as bad [m]."""
_GUARDED_DISTANCE = 5e-3
"""Distance beyond the required one at which bodies may be too near after a step [m]."""
_ENDS = 3
"""Spans of a loop in which the first and the last one differ from the others."""


class ScenePlaces(NamedTuple):
    """Where a robot is at K instants."""

    times: Array  # [s], (K,)
    attitudes: Array  # of the spacecraft, (K, 3, 3)
    bodies: Placements

    def taken(self, rows: IntArray) -> ScenePlaces:
        """Some of the instants."""
        return ScenePlaces(self.times[rows], self.attitudes[rows], self.bodies.taken(rows))


class Placed(NamedTuple):
    """The S bodies of a scene at K instants."""

    rotations: Array  # (K, S, 3, 3)
    positions: Array  # [m], (K, S, 3)


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


class _Seen(NamedTuple):
    """Distances of pairs, and where the second shapes were when these were looked at."""

    distances: Array  # [m], (...)
    centres: Array  # of spheres around the second shapes, frames of the first bodies [m], (..., 3)
    turned: Array  # rotations of their bodies, same frames, (..., 3, 3)

    @classmethod
    def never(cls, *shape: int) -> _Seen:
        """Distances and places of pairs of which nothing is known."""
        return cls(np.full(shape, -np.inf), np.zeros((*shape, 3)), np.zeros((*shape, 3, 3)))

    def bounds(self, now: _Seen, radii: Array) -> Array:
        """Lower bounds of the distances now, with the radii of the spheres [m].

        A motion of a shape changes its distance from another one by at most the displacement of the
        sphere's centre and a turn of its radius.
        """
        shifts = np.linalg.norm(now.centres - self.centres, axis=1)
        turns = np.linalg.norm(now.turned - self.turned, axis=(1, 2)) / np.sqrt(2.0)
        return np.asarray(self.distances - shifts - turns * radii)


class Clearances:
    """Distances of the pairs of a robot and its scene along joint paths."""

    def __init__(
        self, setting: Setting, pairs: CollisionPairs, joints: Array, attitude: Array
    ) -> None:
        """Prepare the pairs; margins grow by :meth:`widen`.

        No larger distances are required than with the joints (n,) and the attitude (3, 3) at the
        start.
        """
        self._setting, self._pairs, self._clearance = setting, pairs, pairs.clearance
        self._arm, self._bodies = PlacedArm.of(setting.model), pairs.bodies
        centres, radii = pairs.spheres
        balls = np.column_stack([self._bodies.ravel(), centres.reshape(-1, 3), radii.ravel()])
        self._balls, numbers = np.unique(balls, axis=0, return_inverse=True)
        self._ball_of = numbers.reshape(-1, 2)
        self._larger_first = np.argsort(-self._balls[self._ball_of, 4], axis=1, kind="stable")
        self._margins = np.full(len(pairs.pairs), _MARGIN)
        self._seen = dict[int, _Seen]()
        self._scene = SceneFrames(setting)
        numbers = np.arange(len(self._bodies))
        place = ScenePlaces(np.zeros(1), attitude[None], Placements.of(self._arm, joints[None]))
        first, none = np.zeros_like(numbers), np.full(len(numbers), -np.inf)
        scene = self._scene.along(place)
        self._known, _, _ = pairs.nearest(joints[None], first, numbers, scene, none)

    @property
    def required(self) -> Array:
        """The distances that are required [m], shape (P,)."""
        least = self._clearance + _MARGIN / 20.0
        return np.clip(self._known - _MARGIN / 20.0, least, self._clearance + self._margins)

    def widen(self, violation: LimitResult) -> bool:
        """See :class:`~freefloat.beyond.missions.goals.violations.ShapeLimits`."""
        if violation.limit != ClearanceLimit.name:
            return False
        lack = violation.allowed - violation.worst
        for number in range(len(self._margins)):
            if self._pairs.name(number) == violation.where:
                self._margins[number] += max(2.0 * lack, self._margins[number])
        return True

    def violations(self, paths: JointPaths, course: JointCourse) -> GoalViolations:
        """See :class:`~freefloat.beyond.missions.goals.violations.ShapeLimits`."""
        edges = self._edges(paths)
        times = course.duration * paths.times[edges]
        places = ScenePlaces(
            times, course.attitudes[edges], Placements.of(self._arm, course.joints[edges])
        )
        scene, required = self._scene.along(places), self.required
        near = required + _GUARDED_DISTANCE
        row, pair, now = self._near(places.bodies, scene, near)
        if len(course.joints) not in self._seen:
            self._seen[len(course.joints)] = _Seen.never(len(course.joints), len(required))
        seen = self._seen[len(course.joints)]
        known = _Seen(*(array[edges[row], pair] for array in seen))
        radii = self._balls[self._ball_of[pair], 4].min(axis=1)
        (chosen,) = np.nonzero(known.bounds(now, radii) < near[pair])
        row, pair, now = row[chosen], pair[chosen], _Seen(*(array[chosen] for array in now))
        now.distances[:], normals, points = self._pairs.nearest(
            course.joints[edges], row, pair, scene, near[pair]
        )
        for array, new in zip(seen, now, strict=True):
            array[edges[row], pair] = new
        lack = required[pair] - now.distances
        rows = np.column_stack([row, pair, lack, normals, points.reshape(-1, 6)])
        return self._with_derivatives(rows[lack > -_GUARDED_DISTANCE], edges, places, paths)

    def _near(
        self, bodies: Placements, scene: Placed, required: Array
    ) -> tuple[IntArray, IntArray, _Seen]:
        """Rows of configurations and pairs whose spheres are too near, with what is seen there."""
        rotations = np.concatenate([bodies.rotations, scene.rotations], axis=1)
        origins = np.concatenate([bodies.origins, scene.positions], axis=1)
        body, (first, second) = self._balls[:, 0].astype(np.int64), self._ball_of.T
        at = np.einsum("ebij,bj->ebi", rotations[:, body], self._balls[:, 1:4])
        centres, radii = at + origins[:, body], self._balls[:, 4]
        between = np.linalg.norm(centres[:, first] - centres[:, second], axis=2)
        gaps = between - radii[first] - radii[second]
        row, pair = np.nonzero(gaps < required)
        order = self._larger_first[pair]
        larger, smaller = np.take_along_axis(self._bodies[pair], order, axis=1).T
        back = rotations[row, larger].transpose(0, 2, 1)
        ball = self._ball_of[pair, order[:, 1]]
        away = centres[row, ball] - origins[row, larger]
        turned = back @ rotations[row, smaller]
        return row, pair, _Seen(gaps[row, pair], np.einsum("mij,mj->mi", back, away), turned)

    def _edges(self, paths: JointPaths) -> IntArray:
        """Ends of intervals to look at: of equal loops the first one and where others differ."""
        edges = np.arange(1, len(paths.times))
        still = not self._setting.scene.bodies and paths.closed
        if paths.loops <= 2 or not still:
            return edges
        loop, ends = len(edges) // paths.loops, _ENDS * len(edges) // paths.all_spans
        return np.concatenate([edges[: loop + ends], edges[-ends:]])

    def _with_derivatives(
        self, table: Array, edges: IntArray, places: ScenePlaces, paths: JointPaths
    ) -> GoalViolations:
        """Violations of rows of edge, pair, lack, normal and both nearest points."""
        n, rows, pair = paths.joint_count, table[:, 0].astype(int), table[:, 1].astype(int)
        lack, normals = table[:, 2], table[:, 3:6]
        by_joints, by_turn = np.zeros((len(table), n)), np.zeros((len(table), 3))
        by_duration = np.zeros(len(table))
        _, origins, axes, centres, centre_rates = places.bodies.taken(rows)
        prismatic = self._arm.prismatic
        for side, sign in ((0, -1.0), (1, 1.0)):  # distances grow where the second point moves
            point, body = table[:, 6 + 3 * side : 9 + 3 * side], self._bodies[pair, side]
            still = self._scene.free[np.maximum(body - n - 1, 0)] & (body > n)
            levers = np.cross(axes, point[:, None] - origins[:, 1:])
            moves = np.where(prismatic[:, None], axes, levers)
            moves *= (np.arange(n) < body[:, None])[:, :, None]
            slopes = np.einsum("mji,mi->mj", moves, normals)
            slopes -= np.einsum("mij,mi->mj", centre_rates, normals)
            by_joints += sign * np.where(still[:, None], 0.0, slopes)
            around = np.cross(point - centres, normals)
            by_turn += sign * np.where(still[:, None], 0.0, around)
            for number in np.unique(body[still]):
                chosen = np.flatnonzero(body == number)
                velocity = self._scene.velocities(
                    number - n - 1, places.taken(rows[chosen]), point[chosen]
                )
                along = (normals[chosen] * velocity).sum(axis=1)
                by_duration[chosen] += sign * paths.times[edges[rows[chosen]]] * along
        amounts = np.minimum(lack, _DEEPEST) / _SCALE
        return GoalViolations(
            edges[rows], amounts, -by_joints / _SCALE, -by_turn / _SCALE, -by_duration / _SCALE
        )
