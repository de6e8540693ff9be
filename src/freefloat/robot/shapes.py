"""Geometries of the shapes of links: boxes, cylinders, spheres, capsules, mesh files."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from freefloat.so3 import Array, frozen


@dataclass(frozen=True, eq=False)
class Box:
    """A box centred on the origin; edges along x, y, z [m], shape (3,).

    Example:
        >>> ff.SceneBody("client", ff.Box([1.0, 1.0, 2.0]), position=[3.0, 0.0, 0.0]).shape.size
        array([1., 1., 2.])
    """

    size: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", frozen(self.size))


@dataclass(frozen=True)
class Cylinder:
    """A cylinder about the z axis, centred on the origin; lengths in metres.

    Example:
        >>> ff.SceneBody("mast", ff.Cylinder(radius=0.1, length=2.0)).shape.length
        2.0
    """

    radius: float
    length: float


@dataclass(frozen=True)
class Sphere:
    """A sphere about the origin; radius in metres.

    Example:
        >>> ff.SceneBody("tank", ff.Sphere(radius=0.4)).shape.radius
        0.4
    """

    radius: float


@dataclass(frozen=True)
class Capsule:
    """A cylinder about the z axis, centred on the origin, with a half sphere on each end."""

    radius: float  # radius of the cylinder and the half spheres [m]
    length: float  # length of the cylinder [m]; the capsule is longer by two radii


@dataclass(frozen=True)
class MeshFile:
    """A mesh file as the URDF names it, and its scale along x, y, z."""

    filename: str
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


Shape = Box | Cylinder | Sphere | Capsule | MeshFile
"""Geometries of links."""


def corners(shape: Box | Cylinder | Sphere | Capsule) -> Array:
    """Corners of the box around a shape in its frame [m], shape (8, 3); z changes fastest."""
    match shape:
        case Box(size=size):
            half = size / 2.0
        case Cylinder(radius=radius, length=length):
            half = np.array([radius, radius, length / 2.0])
        case Capsule(radius=radius, length=length):
            half = np.array([radius, radius, length / 2.0 + radius])
        case Sphere(radius=radius):
            half = np.full(3, radius)
    return np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * half
