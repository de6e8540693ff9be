"""The scene of a motion on the page: bodies beside the robot, and the corridor."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from freefloat.motion.law import corridor_pose, scene_poses
from freefloat.motion.motion import Motion
from freefloat.scene.scene import Corridor
from freefloat.scene.scene_body import SceneBody
from freefloat.scene.tumbling import Tumbling
from freefloat.so3 import Array, Pose
from freefloat.visualization.scenes.description import Label
from freefloat.visualization.scenes.overlays import Surface, surface_of_revolution
from freefloat.visualization.scenes.scene_builder import SceneBuilder, node
from freefloat.visualization.scenes.visuals import (
    Visual,
    Visuals,
    bounding_box,
    drawn_parts,
    frame_along,
)

BODIES, CORRIDOR = "Scene bodies", "Corridor"
"""Nodes of the scene tree that can be hidden, and their names on the page."""
_BODY = (0.93, 0.62, 0.30, 1.0)
_OPACITY = 0.6
_CORRIDOR = (0.35, 0.85, 0.75, 0.16)
_BEYOND = 1.1
"""Length of a corridor over the length of the path along it."""


def body_visuals(number: int, body: SceneBody) -> Visuals:
    """The translucent shapes of a body of the scene with its number."""
    shapes: list[Visual] = []
    problems: list[str] = []
    parts = drawn_parts(f"scene body {body.name}", body.shapes("visual"), body.source, problems)
    for shape, geometry, own in parts:
        red, green, blue, _ = own or shape.colour or _BODY
        name, colour = f"{len(shapes) + 1}", (red, green, blue, _OPACITY)
        shapes.append(Visual(name, number, shape.origin, geometry, colour))
    return Visuals(tuple(shapes), tuple(problems))


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The scene at key times of a motion."""

    motion: Motion  # the motion
    times: Array  # the key times [s], (K,)
    poses: tuple[Pose, ...]  # frames of the bodies at these times
    corridor: Pose | None  # frames of the corridor at these times; None without one
    visuals: tuple[Visuals, ...]  # shapes of the bodies

    @classmethod
    def of(cls, motion: Motion, times: Array, places: Array) -> Surroundings:
        """The surroundings of a motion at some times [s], whose panel coordinates are given."""
        scene, states = motion.setting.scene, (times, *motion.evaluate(places)[1:])
        corridor = None if scene.corridor is None else corridor_pose(motion.law, *states)
        visuals = tuple(body_visuals(k, body) for k, body in enumerate(scene.bodies))
        return cls(motion, times, scene_poses(motion.law, *states), corridor, visuals)

    @property
    def items(self) -> tuple[str, ...]:
        """The items of the page that it has."""
        scene = self.motion.setting.scene
        return (BODIES,) * bool(scene.bodies) + (CORRIDOR,) * (scene.corridor is not None)

    @property
    def problems(self) -> tuple[str, ...]:
        """Messages on shapes that cannot be drawn."""
        return tuple(problem for visuals in self.visuals for problem in visuals.problems)

    def extent(self) -> Iterator[Array]:
        """Yield corners of boxes around the shapes at the first and the last time [m], (8, 3)."""
        for poses, visuals in zip(self.poses, self.visuals, strict=True):
            for pose, visual in product((poses[0], poses[-1]), visuals.shapes):
                yield pose.position + bounding_box(visual) @ pose.rotation.T

    def places(self) -> Iterator[Array]:
        """Yield the centre of each body at the first time [m], shape (3,)."""
        for poses, visuals in zip(self.poses, self.visuals, strict=True):
            if visuals.shapes:
                corners = np.vstack([bounding_box(visual) for visual in visuals.shapes])
                yield poses[0].position + poses[0].rotation @ corners.mean(axis=0)

    def draw(self, builder: SceneBuilder, root: str) -> list[Label]:
        """Draw the bodies and the corridor below a node; return the labels of the bodies."""
        labels, setting = [], self.motion.setting
        for number, body in enumerate(setting.scene.bodies):
            path = f"{root}/{BODIES}/{node(body.name)}"
            for visual in self.visuals[number].shapes:
                builder.visual(f"{path}/{visual.name}", visual)
            _move(builder, path, self.times, self.poses[number])
            if body.motion != "target" and not setting.drifts:  # labels do not move
                com = body.motion.com if isinstance(body.motion, Tumbling) else np.zeros(3)
                place = body.position + body.orientation @ com
                labels.append(Label(body.name, place.tolist(), BODIES))
        corridor, path = setting.scene.corridor, f"{root}/{CORRIDOR}"
        if corridor is not None and self.corridor is not None:
            surface = _corridor_surface(corridor, self._path_in_corridor())
            builder.mesh(path, surface, _CORRIDOR, shaded=False)
            _move(builder, path, self.times, self.corridor)
        return labels

    def _path_in_corridor(self) -> Array:
        """Points of the path in the corridor's frame [m], shape (K, 3)."""
        motion, times = self.motion, np.linspace(0.0, self.motion.law.timing.duration, 101)
        known = np.clip(times, motion.times.min(), motion.times.max())
        states = times, *motion.evaluate(motion.coordinates_at(known))[1:]
        frames = corridor_pose(motion.law, *states)
        return (frames.inverse() @ motion.law.target(*states)).position


def _corridor_surface(corridor: Corridor, path: Array) -> Surface:
    """Vertices and faces of a corridor that is as long as a path (K, 3) in its frame."""
    offsets = path - corridor.point
    along = offsets @ corridor.axis
    if corridor.half_angle is None:
        half = _BEYOND * max(float(np.ptp(along)) / 2.0, corridor.allowed)
        ends = (along.max() + along.min()) / 2.0 + half * np.array([-1.0, 1.0])
        radii = np.full(2, corridor.allowed)
    else:
        slant = _BEYOND * float(np.linalg.norm(offsets, axis=1).max())
        ends = np.array([0.0, slant * np.cos(corridor.half_angle)])
        radii = np.array([0.0, slant * np.sin(corridor.half_angle)])
    vertices, faces = surface_of_revolution(ends, radii)
    return corridor.point + vertices @ frame_along(corridor.axis).T, faces


def _move(builder: SceneBuilder, path: str, times: Array, poses: Pose) -> None:
    """Place a path at a frame that rests, or move it with another."""
    if np.ptp(poses.position, axis=0).any() or np.ptp(poses.rotation, axis=0).any():
        builder.move(path, times, poses.position, poses.quaternion)
    else:
        builder.place(path, poses[0])
