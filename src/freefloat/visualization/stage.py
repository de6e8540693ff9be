"""A MeshCat scene without a server: what would be sent to one is collected, in order.

Objects are collected apart from tracks because a viewer must know the former first.
"""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import sha256
from typing import Any

import numpy as np
import numpy.typing as npt
import umsgpack
from meshcat import geometry as g
from meshcat.commands import SetObject, SetProperty, SetTransform
from meshcat.path import Path

from freefloat.so3 import Array, IntArray, Pose

ROOT = "meshcat"
"""First part of all paths but those of lights, camera and background."""
_FLOAT32 = 0x17
_UNSHADED = {"reflectivity": 0.0}

Colour = Sequence[float]


class Stage:
    """Collects MeshCat commands."""

    def __init__(self) -> None:
        self._objects: list[bytes] = []
        self._tracks: dict[str, list[dict[str, Any]]] = {}
        self._copies: list[tuple[str, str]] = []
        self._known: dict[str, str] = {}

    @property
    def objects(self) -> tuple[bytes, ...]:
        """Commands that make the scene, msgpack."""
        return tuple(self._objects)

    @property
    def copies(self) -> tuple[tuple[str, str], ...]:
        """Paths whose object is that of another path, told once: from, to."""
        return tuple(self._copies)

    def animation(self, duration: float) -> bytes:
        """The command that gives the scene its tracks, msgpack.

        Args:
            duration: Of all clips [s]; the viewer freezes those that are shorter than others.
        """
        clips = [
            {"path": path, "clip": {"name": "default", "duration": duration, "tracks": tracks}}
            for path, tracks in self._tracks.items()
        ]
        options = {"play": False, "repetitions": 1}
        command = {"type": "set_animation", "path": "", "animations": clips, "options": options}
        return bytes(umsgpack.packb(command))

    def mesh(
        self, path: str, geometry: Any, colour: Colour, *, shaded: bool = True, hidden: bool = True
    ) -> None:
        """Put a surface at a path.

        Args:
            path: Where.
            geometry: MeshCat's.
            colour: Red, green, blue and opacity, in [0, 1].
            shaded: Whether light matters.
            hidden: Whether what stands before it hides it.
        """
        red, green, blue, opacity = colour
        kind = g.MeshLambertMaterial if shaded else g.MeshBasicMaterial
        material = kind(
            color=_number(red, green, blue), opacity=float(opacity), depthWrite=opacity == 1.0,
            **_UNSHADED, **_seen(hidden),
        )  # fmt: skip
        if not hidden:
            material.transparent = True  # these are drawn last
        self._put(path, g.Mesh(geometry, material))

    def coloured_mesh(
        self, path: str, vertices: Array, faces: IntArray, colours: Array, *, hidden: bool = True
    ) -> None:
        """Put triangles (F, 3) with a colour (V, 3) at every vertex (V, 3), whatever the light."""
        geometry = g.TriangularMeshGeometry(vertices, faces, colours)
        material = g.MeshBasicMaterial(
            vertexColors=True, transparent=not hidden, **_UNSHADED, **_seen(hidden)
        )
        self._put(path, g.Mesh(geometry, material))

    def points(self, path: str, points: Array, colours: Array, size: float) -> None:
        """Put points (K, 3) with colours (K, 3), of a size in metres."""
        geometry = g.PointsGeometry(_single(points.T), _single(colours.T))
        self._put(path, g.Points(geometry, g.PointsMaterial(size=float(size))))

    def place(self, path: str, pose: Pose) -> None:
        """Say where a path is in the one above."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = pose.rotation, pose.position
        command = SetTransform(matrix, _path(path)).lower()
        command["matrix"] = [float(value) for value in command["matrix"]]
        self._objects.append(umsgpack.packb(command))

    def set(self, path: str, key: str, value: Any) -> None:
        """Set a property of a path, or of its object where the path ends in ``<object>``."""
        command = SetProperty(key, value, _path(path)).lower()
        self._objects.append(umsgpack.packb(command))

    def move(self, path: str, times: Array, positions: Array, quaternions: Array) -> None:
        """Move a path: positions (K, 3), quaternions x, y, z, w (K, 4) at times (K,)."""
        self._track(path, "position", "vector3", times, _floats(positions))
        self._track(path, "quaternion", "quaternion", times, _floats(quaternions))

    def appear(self, path: str, time: float) -> None:
        """Show a path from a time [s] on."""
        if time > 0.0:
            self._track(path, "visible", "boolean", np.array([0.0, time]), [False, True])

    def _track(self, path: str, name: str, kind: str, times: Array, values: Any) -> None:
        track = {"name": f".{name}", "type": kind, "times": _floats(times), "values": values}
        self._tracks.setdefault(_path(path).lower(), []).append(track)

    def _put(self, path: str, thing: Any) -> None:
        """Tell an object, or that it is the same as one told before."""
        parts = thing, thing.geometry, thing.material
        for part in parts:
            part.uuid = ""  # MeshCat's are random
        content = sha256(umsgpack.packb(thing.lower())).hexdigest()
        if content in self._known:
            self._copies.append((self._known[content], path))
            return
        for number, part in enumerate(parts):
            part.uuid = f"{len(self._known)}-{number}"
        self._known[content] = path
        self._objects.append(umsgpack.packb(SetObject(thing, path=_path(path)).lower()))


def _seen(hidden: bool) -> dict[str, Any]:
    """Properties of a material that is seen through what stands before it, or not."""
    return {} if hidden else {"depthTest": False}


def cylinder(radius: float, length: float) -> tuple[Any, Pose]:
    """MeshCat's cylinder, which stands along y, and what turns y into z."""
    return g.Cylinder(float(length), float(radius)), Pose(
        np.zeros(3), np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    )


def node(name: str) -> str:
    """A name as one node of a path: a slash would split it."""
    return name.replace("/", "∕").strip() or "unnamed"


def _path(path: str) -> Path:
    return Path(tuple(part for part in path.split("/") if part))


def _number(*rgb: float) -> int:
    red, green, blue = (round(255.0 * float(value)) for value in rgb)
    return (red << 16) + (green << 8) + blue


def _single(values: Array) -> npt.NDArray[np.float32]:
    return np.ascontiguousarray(values, dtype=np.float32)


def _floats(values: Array) -> Any:
    return umsgpack.Ext(_FLOAT32, np.ascontiguousarray(values, dtype="<f4").tobytes())
