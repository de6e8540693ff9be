"""What is drawn of a robot: plain bodies and meshes, each with its place and colour."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from freefloat.so3 import Array, IntArray, Pose, axes_rotation, frozen

Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity, each from 0 to 1."""


@dataclass(frozen=True, eq=False)
class Box:
    """A box about the origin.

    Attributes:
        size: Its edges along x, y, z [m], shape (3,).
    """

    size: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", frozen(self.size))


@dataclass(frozen=True)
class Cylinder:
    """A cylinder about the z axis, half of it on either side of the origin; lengths in metres."""

    radius: float
    length: float


@dataclass(frozen=True)
class Sphere:
    """A ball about the origin; its radius in metres."""

    radius: float


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles, anticlockwise when seen from outside.

    Attributes:
        vertices: [m], shape (V, 3).
        faces: Indices of three vertices each, shape (F, 3).
        normals: Outward unit vectors at the vertices, shape (V, 3). A vertex on a sharp edge is
            there once for each side.
    """

    vertices: Array
    faces: IntArray
    normals: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", frozen(self.vertices))
        object.__setattr__(self, "normals", frozen(self.normals))
        faces = np.array(self.faces, dtype=np.int64)
        faces.setflags(write=False)
        object.__setattr__(self, "faces", faces)


Shape = Box | Cylinder | Sphere | Mesh


@dataclass(frozen=True, eq=False)
class Visual:
    """One shape of one link.

    Attributes:
        name: The link's name, numbered where it has several: unlike any other of the robot.
        body: The moving body it belongs to: 0 is the spacecraft, k is moved by joint k.
        placement: In the body's joint frame.
        shape: What it looks like.
        colour: Of all of it.
    """

    name: str
    body: int
    placement: Pose
    shape: Shape
    colour: Colour


def along(position: npt.ArrayLike, direction: npt.ArrayLike) -> Pose:
    """A frame somewhere, its z axis along a direction (3,) of any length but zero."""
    other = "xyz"[int(np.argmin(np.abs(direction)))]
    across = np.eye(3)["xyz".index(other)]
    rotation = axes_rotation("direction", ("z", direction), ("x", across))
    return Pose(frozen(position), rotation)
