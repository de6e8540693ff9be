"""Motions at the key times of their playback, and the cones of their limits of pointing."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from matplotlib.colors import to_hex

from freefloat.motion.motion import Motion
from freefloat.motion.pointing import Keep, PointingLimit
from freefloat.regions.workspace import Workspace
from freefloat.rotations import Rotation
from freefloat.scene.tumbling import Tumbling
from freefloat.so3 import Array, IntArray
from freefloat.visualization.scenes.description import Label
from freefloat.visualization.scenes.overlays import (
    Surface,
    arrow,
    surface_of_revolution,
    thickness,
    tube,
)
from freefloat.visualization.scenes.scene_builder import SceneBuilder
from freefloat.visualization.scenes.surroundings import Surroundings
from freefloat.visualization.scenes.visuals import Visuals, body_poses, frame_along, largest_box

_RATE, _PLAYBACK, _PER_TURN = 25.0, 30.0, 12.0
"""Key frames per second of playback; longest initial playback time [s]; frames per revolution."""
MAX_KEYS = 6000
"""Key frames of all motions together."""
POINTING = "Pointing limits"
"""Node of the scene tree that can be hidden, and its name on the page."""
_COLOURS = {
    Keep.INSIDE: ((0.55, 0.90, 0.30), (0.25, 0.80, 0.95), (0.85, 0.85, 0.35)),
    Keep.OUTSIDE: ((0.95, 0.35, 0.30), (1.00, 0.50, 0.80), (1.00, 0.60, 0.25)),
}
"""Colours of the first, second, ... limit: its cone, axis and label."""
_OPACITY = 0.16
_SHORTEST = 50.0
"""Smallest length of cones and arrows over the thickness of lines."""
_BEYOND = 2.0
"""Their length over the distance from the link's origin to the corners of its largest shape."""


def key_times(motion: Motion, limit: int = MAX_KEYS) -> Array:
    """The times of a motion's key frames [s], shape (K,), in single precision.

    The union of evenly spaced times, 25 per second of playback and 12 per revolution of a tumbling
    body, and of the integration nodes, which are dense near singularities.

    Args:
        motion: The motion.
        limit: Maximum number of key frames.
    """
    first, last = float(motion.times.min()), float(motion.times.max())
    bodies = motion.setting.scene.bodies
    tumbling = [body.motion for body in bodies if isinstance(body.motion, Tumbling)]
    turns = max((body.revolutions(last - first) for body in tumbling), default=0.0)
    count = int(np.ceil(max(_RATE * min(last - first, _PLAYBACK), _PER_TURN * turns))) + 1
    count = min(count, limit // 2)
    nodes = motion.times[:: 1 + 2 * len(motion.times) // limit]
    times = np.concatenate([np.linspace(first, last, count), nodes]).astype(np.float32)
    return np.unique(np.clip(times.astype(float), first, last))


@dataclass(frozen=True, eq=False)
class SampledMotion:
    """A motion at its key times: poses of bodies and end-effector, |measure|, s, surroundings."""

    motion: Motion  # the motion
    visuals: Visuals  # shapes of its robot
    areas: Workspace | None  # path-dependent and path-independent areas, where they are known
    pointing: tuple[PointingLimit, ...]  # limits of pointing that are drawn
    times: Array  # key times [s], (K,)
    positions: Array  # positions of the bodies and the end-effector [m], (K, bodies, 3)
    rotations: Array  # axes of the bodies, (K, bodies, 3, 3)
    joints: Array  # joint values [rad or m], (K, n)
    values: Array  # magnitudes of the measure, (K,)
    fractions: Array  # values of s, (K,)
    surroundings: Surroundings  # the scene

    @classmethod
    def of(
        cls,
        motion: Motion,
        visuals: Visuals,
        areas: Workspace | None,
        pointing: tuple[PointingLimit, ...],
        limit: int,
    ) -> SampledMotion:
        """A motion at no more key times than a limit."""
        setting = motion.setting
        times = key_times(motion, limit)
        parameters = motion.coordinates_at(times)
        # Exact end points: a singular motion has no state after its end.
        parameters[[0, -1]] = motion.coordinates_at([motion.times.min(), motion.times.max()])
        joints = motion.evaluate(parameters)[2]
        values, fractions = abs(setting.margin.measure(joints)), motion.law.timing.s(times)
        poses = body_poses(motion, parameters)
        samples = (times, *poses, joints, values, fractions)
        return cls(
            motion, visuals, areas, pointing, *samples, Surroundings.of(motion, times, parameters)
        )

    def carried(self, body: int, points: Array, instants: slice | IntArray = slice(None)) -> Array:
        """Points (P, 3) of a body along the motion, frame of the path [m], shape (K P, 3)."""
        rotations = self.rotations[instants, body].swapaxes(1, 2)
        return (self.positions[instants, body, None] + points @ rotations).reshape(-1, 3)

    @cached_property
    def cones(self) -> tuple[PointingCone, ...]:
        """Cones of the limits of pointing."""
        return tuple(PointingCone.of(self, *numbered) for numbered in enumerate(self.pointing))


@dataclass(frozen=True, eq=False)
class PointingCone:
    """A limit of pointing along a motion: the cone about its target, and the axis that it limits.

    Attributes:
        number: Number of the limit among the limits of pointing that are drawn.
        limit: The limit.
        times: Key times [s], shape (K,).
        origins: Origins of the link's frame from the centre of mass, inertial axes [m], (K, 3).
        axes: Rotations of the link's frame, shape (K, 3, 3).
        targets: Unit vectors toward the target, inertial axes, shape (K, 3).
        length: Length of the arrow, and from the apex of the cone to its rim [m].
    """

    number: int
    limit: PointingLimit
    times: Array
    origins: Array
    axes: Array
    targets: Array
    length: float

    @classmethod
    def of(cls, sampled: SampledMotion, number: int, limit: PointingLimit) -> PointingCone:
        """The cone of a numbered limit along a motion."""
        setting, times = sampled.motion.setting, sampled.times
        body, place = setting.model.link_places[limit.body]
        rotations = sampled.rotations[:, body]
        origins = sampled.positions[:, body] + rotations @ place.position
        if limit.point is None:
            sights = np.tile(np.asarray(limit.direction), (len(times), 1))
        else:
            sights = limit.point + setting.origin(times) - origins
        targets = sights / np.linalg.norm(sights, axis=1, keepdims=True)
        corners = largest_box(sampled.visuals, body) - place.position
        farthest = float(np.linalg.norm(corners, axis=1).max())
        length = max(_BEYOND * farthest, _SHORTEST * thickness(setting))
        return cls(number, limit, times, origins, rotations @ place.rotation, targets, length)

    @property
    def title(self) -> str:
        """Name or number of the limit and its cone, such as ``pointing.0 inside 30°``."""
        name = self.limit.name or f"pointing.{self.number}"
        return f"{name} {self.limit.keep} {np.degrees(self.limit.angle):.4g}°"

    def extent(self) -> Array:
        """Tip of the arrow and points of the rim at the first and the last time [m], (K, 3)."""
        tips = self.origins[[0, -1]] + self.length * self.axes[[0, -1]] @ self.limit.axis
        rims = [self.origins[k] + self._rim @ frame_along(self.targets[k]).T for k in (0, -1)]
        return np.vstack([tips, *rims])

    @cached_property
    def _surface(self) -> Surface:
        """The surface of the cone about the z axis, from its apex to its rim."""
        angle = self.limit.angle
        return surface_of_revolution(*np.outer([np.cos(angle), np.sin(angle)], [0.0, self.length]))

    @property
    def _rim(self) -> Array:
        """Points of the rim of that surface [m], shape (K, 3)."""
        return self._surface[0][1::2]

    def draw(self, builder: SceneBuilder, root: str, radius: float) -> Label:
        """Draw it below a node, with lines of a radius [m]; return the label of the arrow."""
        path = f"{POINTING}/pointing.{self.number}"
        colours = _COLOURS[self.limit.keep]
        colour = colours[self.number % len(colours)]
        cone, rim = f"{root}/{path}/cone", np.vstack([self._rim, self._rim[:1]])
        builder.mesh(f"{cone}/surface", self._surface, (*colour, _OPACITY), shaded=False)
        builder.mesh(f"{cone}/rim", tube(rim, 0.5 * radius), (*colour, 1.0), shaded=False)
        end = self.length * self.limit.axis
        builder.mesh(f"{root}/{path}/axis", arrow(end, 0.8 * radius), (*colour, 1.0))
        frames = np.array([frame_along(target) for target in self.targets])
        for name, rotations in (("cone", frames), ("axis", self.axes)):
            quaternions = Rotation.from_matrix(rotations).as_quat()
            builder.move(f"{root}/{path}/{name}", self.times, self.origins, quaternions)
        node = f"{path}/axis"
        return Label(self.title, end.tolist(), POINTING, node=node, colour=to_hex(colour))
