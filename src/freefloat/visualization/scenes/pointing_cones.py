"""Limits of pointing on the page: the cone about each target, and the axis that it limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.colors import to_hex

from freefloat.motion.pointing import Keep, PointingLimit
from freefloat.motion.problem import Problem
from freefloat.rotations import Rotation
from freefloat.so3 import Array, axes_rotation
from freefloat.visualization.scenes.description import Label
from freefloat.visualization.scenes.overlays import arrow, surface_of_revolution, thickness, tube
from freefloat.visualization.scenes.scene_builder import SceneBuilder
from freefloat.visualization.scenes.visuals import RobotVisuals, largest_box

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
_RIM, _CORNERS = 64, 16
"""Corners of the line along the rim; those that the view covers."""


@dataclass(frozen=True, eq=False)
class PointingCone:
    """A limit of pointing along a motion.

    Attributes:
        limit: The limit.
        number: Its number among those of the problem.
        times: Key times [s], shape (K,).
        origins: Origins of the link's frame from the centre of mass, inertial axes [m], (K, 3).
        axes: Rotations of the link's frame, shape (K, 3, 3).
        targets: Unit vectors toward the target, inertial axes, shape (K, 3).
        length: Length of the arrow, and from the apex of the cone to its rim [m].
    """

    limit: PointingLimit
    number: int
    times: Array
    origins: Array
    axes: Array
    targets: Array
    length: float

    @classmethod
    def of(
        cls,
        problem: Problem,
        limit: PointingLimit,
        number: int,
        times: Array,
        poses: tuple[Array, Array],
        visuals: RobotVisuals,
    ) -> PointingCone:
        """The cone of a limit of a problem.

        Args:
            problem: The problem.
            limit: The limit.
            number: Its number among those of the problem.
            times: Key times [s], shape (K,).
            poses: Positions (K, bodies, 3) and rotations (K, bodies, 3, 3) of the bodies.
            visuals: Shapes of the robot.
        """
        positions, rotations = poses
        body, place = problem.model.link_places[limit.body]
        origins = positions[:, body] + rotations[:, body] @ place.position
        if limit.point is None:
            sights = np.tile(np.asarray(limit.direction), (len(times), 1))
        else:
            sights = limit.point + [problem.path.origin(float(t)) for t in times] - origins
        corners = largest_box(visuals, body) - place.position
        farthest = np.linalg.norm(corners, axis=1).max()
        return cls(
            limit,
            number,
            times,
            origins,
            rotations[:, body] @ place.rotation,
            sights / np.linalg.norm(sights, axis=1, keepdims=True),
            max(_BEYOND * float(farthest), _SHORTEST * thickness(problem)),
        )

    @property
    def title(self) -> str:
        """Its name or number and its cone, such as ``pointing.0 inside 30°``."""
        name = self.limit.name or f"pointing.{self.number}"
        return f"{name} {self.limit.keep} {np.degrees(self.limit.angle):.4g}°"

    def extent(self) -> Array:
        """Tip of the arrow and points of the rim at the first and the last time [m], (K, 3)."""
        rim = self._rim(_CORNERS)
        tips = self.origins[[0, -1]] + self.length * self.axes[[0, -1]] @ self.limit.axis
        rims = [self.origins[k] + rim @ _frame_along(self.targets[k]).T for k in (0, -1)]
        return np.vstack([tips, *rims])

    def _rim(self, corners: int) -> Array:
        """Points of a closed line along the rim of a cone about z [m], (corners + 1, 3)."""
        around = np.linspace(0.0, 2.0 * np.pi, corners + 1)
        sine, cosine = np.sin(self.limit.angle), np.cos(self.limit.angle)
        parts = sine * np.cos(around), sine * np.sin(around), np.full_like(around, cosine)
        return self.length * np.column_stack(parts)

    def draw(self, builder: SceneBuilder, root: str, radius: float) -> Label:
        """Draw it below a node, with lines of a radius [m]; return the label of the arrow."""
        path = f"{POINTING}/pointing.{self.number}"
        colours, angle = _COLOURS[self.limit.keep], self.limit.angle
        colour = colours[self.number % len(colours)]
        rim = self.length * np.array([np.sin(angle), np.cos(angle)])
        cone = surface_of_revolution(np.array([0.0, rim[1]]), np.array([0.0, rim[0]]))
        builder.mesh(f"{root}/{path}/cone/surface", cone, (*colour, _OPACITY), shaded=False)
        builder.mesh(f"{root}/{path}/cone/rim", tube(self._rim(_RIM), 0.5 * radius),
                     (*colour, 1.0), shaded=False)  # fmt: skip
        end = self.length * self.limit.axis
        builder.mesh(f"{root}/{path}/axis", arrow(end, 0.8 * radius), (*colour, 1.0))
        frames = np.array([_frame_along(target) for target in self.targets])
        for name, rotations in (("cone", frames), ("axis", self.axes)):
            quaternions = Rotation.from_matrix(rotations).as_quat()
            builder.move(f"{root}/{path}/{name}", self.times, self.origins, quaternions)
        node = f"{path}/axis"
        return Label(self.title, end.tolist(), POINTING, node=node, colour=to_hex(colour))


def _frame_along(direction: Array) -> Array:
    """A frame whose z axis has a direction (3,)."""
    across = np.eye(3)[int(np.argmin(np.abs(direction)))]
    return axes_rotation("direction", ("z", direction), ("x", across))
