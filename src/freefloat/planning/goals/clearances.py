"""Clearances along joint paths: distances that are too small, with their derivatives.

Spheres around the shapes leave out pairs that are far apart. The distance of the others grows
along the direction between their nearest points, which move with their bodies.
"""

from __future__ import annotations

import numpy as np

from freefloat.limits.pairs import CollisionPairs
from freefloat.motion.problem import Problem
from freefloat.planning.goals.joint_paths import Course, JointPaths
from freefloat.planning.goals.placements import Arm, place_all
from freefloat.planning.goals.scene_frames import Placed, Places, SceneFrames
from freefloat.planning.goals.violations import Violations
from freefloat.so3 import Array, IntArray

_MARGIN = 2e-3
"""Margin for the instants between those that are looked at [m]."""
_SCALE = 0.02
"""Lack of distance that counts as one [m]."""
_DEEPEST = 0.15
"""Largest lack that counts: deeper penetrations are only as bad [m]."""
_ENDS = 3
"""Spans of a loop in which the first and the last one differ from the others."""


class Clearances:
    """Distances of the pairs of a robot and its scene along joint paths."""

    def __init__(self, problem: Problem, pairs: CollisionPairs, clearance: float) -> None:
        """Prepare the pairs; the margins grow by :meth:`widen`.

        Args:
            problem: Robot, scene and drift, whatever its duration.
            pairs: The pairs that keep the clearance.
            clearance: The clearance [m].
        """
        self._problem, self._pairs, self._clearance = problem, pairs, clearance
        self._arm, self._bodies = Arm.of(problem.model), pairs.bodies
        self._centres, self._radii = pairs.spheres
        self._margins = np.full(len(pairs.pairs), _MARGIN)
        self._known = np.full(len(pairs.pairs), np.inf)
        strokes = np.nan_to_num(np.abs(problem.model.joint_ranges).max(axis=0), posinf=1e3)
        self._levers = pairs.levers(strokes)
        self._seen = dict[int, tuple[Array, Array]]()
        self._scene = SceneFrames(problem)

    @property
    def required(self) -> Array:
        """The distances that are required [m], shape (P,)."""
        least = self._clearance + _MARGIN / 20.0
        return np.clip(self._known - _MARGIN / 20.0, least, self._clearance + self._margins)

    def at_rest(self, joints: Array, attitude: Array, t: float = 0.0) -> None:
        """Require no larger distances than there are where a path must begin or end."""
        every = np.arange(len(self._bodies))
        place = Places(np.array([t]), attitude[None], self._placed(joints[None]))
        poses = self._scene.along(place).poses(0)
        self._known = np.minimum(self._known, self._pairs.nearest(joints, every, poses, 0.0)[0])

    def widen(self, name: str, lack: float) -> None:
        """Require a larger distance of the pairs with a name, which lacked some [m]."""
        for number in range(len(self._margins)):
            if self._pairs.name(number) == name:
                self._margins[number] += max(2.0 * lack, self._margins[number])

    def violations(self, paths: JointPaths, course: Course) -> Violations:
        """See :class:`~freefloat.planning.goals.violations.ShapeLimits`."""
        edges = self._edges(paths)
        times = course.duration * paths.times[edges]
        places = Places(times, course.attitudes[edges], self._placed(course.joints[edges]))
        scene = self._scene.along(places)
        near = np.logical_and(
            self._may_be_near(places.frames, scene), self._may_have_come_near(course, edges)
        )
        required, rows = self.required, []
        known, joints = self._seen[len(course.joints)]
        for row, edge in enumerate(edges):
            (chosen,) = np.nonzero(near[row])
            if not len(chosen):
                continue
            distances, normals, points = self._pairs.nearest(
                course.joints[edge], chosen, scene.poses(row), float(required.max())
            )
            known[edge, chosen], joints[edge, chosen] = distances, course.joints[edge]
            for k in np.flatnonzero(distances < required[chosen]):
                pair = chosen[k]
                rows.append((row, pair, required[pair] - distances[k], *normals[k],
                             *points[k].ravel()))  # fmt: skip
        table = np.array(rows).reshape(-1, 12)
        return self._with_derivatives(table, edges, places, paths)

    def _may_have_come_near(self, course: Course, edges: IntArray) -> Array:
        """Which pairs may be nearer than required, by their distances when they were looked at.

        Shape (edges, P). A joint changes the distance of a pair by at most its lever.
        """
        size = len(course.joints), len(self._bodies)
        if len(course.joints) not in self._seen:
            joints = np.zeros((*size, course.joints.shape[1]))
            self._seen[len(course.joints)] = np.full(size, -np.inf), joints
        known, joints = (values[edges] for values in self._seen[len(course.joints)])
        moved = np.abs(course.joints[edges][:, None] - joints)
        bounds = known - np.einsum("epj,pj->ep", moved, self._levers)
        return np.asarray((bounds < self.required) | ~self._levers.any(axis=1))

    def _edges(self, paths: JointPaths) -> IntArray:
        """Ends of intervals to look at: of equal loops the first one and where others differ."""
        every = np.arange(1, len(paths.times))
        still = not self._problem.scene.bodies and paths.closed
        if paths.loops <= 2 or not still:
            return every
        loop, ends = len(every) // paths.loops, _ENDS * len(every) // paths.all_spans
        return np.concatenate([every[: loop + ends], every[-ends:]])

    def _placed(self, joints: Array) -> tuple[Array, ...]:
        """The bodies in configurations (K, n), see :func:`place_all`."""
        joints = np.ascontiguousarray(joints)
        K, n = joints.shape
        shapes = (K, n + 1, 3, 3), (K, n + 1, 3), (K, n, 3), (K, 3), (K, 3, n)
        arrays = tuple(np.empty(shape) for shape in shapes)
        place_all(self._arm, joints, *arrays)
        return arrays

    def _may_be_near(self, frames: tuple[Array, ...], scene: Placed) -> Array:
        """Which pairs may be nearer than required, by their spheres, shape (edges, P)."""
        rotations = np.concatenate([frames[0], scene.rotations], axis=1)
        origins = np.concatenate([frames[1], scene.positions], axis=1)
        first, second = (
            np.einsum("epij,pj->epi", rotations[:, self._bodies[:, k]], self._centres[:, k])
            + origins[:, self._bodies[:, k]]
            for k in range(2)
        )
        gaps = np.linalg.norm(first - second, axis=2) - self._radii.sum(axis=1)
        return np.asarray(gaps < self.required)

    def _with_derivatives(
        self, table: Array, edges: IntArray, places: Places, paths: JointPaths
    ) -> Violations:
        """Violations of rows of edge, pair, lack, normal and both nearest points."""
        n, rows, pair = paths.joint_count, table[:, 0].astype(int), table[:, 1].astype(int)
        lack, normals = table[:, 2], table[:, 3:6]
        by_joints, by_turn = np.zeros((len(table), n)), np.zeros((len(table), 3))
        by_duration = np.zeros(len(table))
        _, origins, axes, centres, centre_rates = (array[rows] for array in places.frames)
        prismatic = self._arm.prismatic != 0.0
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
        return Violations(
            edges[rows], amounts, -by_joints / _SCALE, -by_turn / _SCALE, -by_duration / _SCALE
        )
