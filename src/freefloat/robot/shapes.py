"""Geometric shapes of links, and what is drawn of a robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from freefloat.so3 import Array, IntArray, Pose, axes_rotation, frozen

Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity, each from 0 to 1."""


@dataclass(frozen=True, eq=False)
class Box:
    """A box centred on the origin.

    Attributes:
        size: Edges along x, y, z [m], shape (3,).
    """

    size: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", frozen(self.size))


@dataclass(frozen=True)
class Cylinder:
    """A cylinder about the z axis, centred on the origin; lengths in metres."""

    radius: float
    length: float


@dataclass(frozen=True)
class Sphere:
    """A sphere about the origin; radius in metres."""

    radius: float


@dataclass(frozen=True)
class MeshFile:
    """A mesh as a URDF names it.

    Attributes:
        filename: As in the URDF, see :func:`freefloat.robot.names.find_mesh`.
        scale: Factors along x, y, z.
    """

    filename: str
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles, anticlockwise when seen from outside.

    Attributes:
        vertices: [m], shape (V, 3).
        faces: Indices of three vertices each, shape (F, 3).
        normals: Outward unit vectors at the vertices, shape (V, 3). A vertex on a sharp edge
            appears once for each side.
    """

    vertices: Array
    faces: IntArray
    normals: Array

    def __post_init__(self) -> None:
        for name in ("vertices", "normals"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        faces = np.array(self.faces, dtype=np.int64)
        faces.setflags(write=False)
        object.__setattr__(self, "faces", faces)


Shape = Box | Cylinder | Sphere | Mesh


@dataclass(frozen=True, eq=False)
class Visual:
    """A shape of a link, as it is drawn.

    Attributes:
        name: Name of the link, numbered where it has several shapes; unique in the robot.
        body: The rigid body that it is part of: 0 is the spacecraft, k is moved by joint k.
        placement: Its frame in the body's joint frame.
        shape: Its geometry.
        colour: Of the whole shape.
    """

    name: str
    body: int
    placement: Pose
    shape: Shape
    colour: Colour


def along(position: npt.ArrayLike, direction: npt.ArrayLike) -> Pose:
    """A frame at a position with its z axis along a direction (3,) of any length but zero."""
    across = np.eye(3)[int(np.argmin(np.abs(direction)))]
    rotation = axes_rotation("direction", ("z", direction), ("x", across))
    return Pose(frozen(position), rotation)


def breaks_triangle(moments: npt.ArrayLike) -> bool:
    """Whether no rigid body has these principal moments of inertia, ascending, shape (3,)."""
    smallest, middle, largest = np.asarray(moments, dtype=float).tolist()
    return bool(smallest + middle < largest * (1.0 - 1e-9))
