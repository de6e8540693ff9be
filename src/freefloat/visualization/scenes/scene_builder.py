"""MeshCat commands of a scene, collected without a server.

Objects and tracks are separate, as a viewer drops the tracks of unknown objects.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

import numpy as np
import umsgpack
from matplotlib.colors import to_hex
from meshcat import geometry as g
from meshcat.commands import SetObject, SetProperty, SetTransform
from meshcat.path import Path

from freefloat.robot.shapes import Box, Cylinder, Sphere
from freefloat.rotations import rotation_matrix
from freefloat.so3 import Array, IntArray, Pose
from freefloat.visualization.scenes.description import SceneDescription
from freefloat.visualization.scenes.visuals import Visual

ROOT = "meshcat"
"""First part of all paths except the paths of lights, camera and background."""
FRONT_SIDE, BACK_SIDE, BOTH_SIDES = 0, 1, 2
"""Sides of a surface, as numbered by three.js."""
_FLOAT32 = 0x17
_UPRIGHT = Pose(np.zeros(3), np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]]))
"""Rotates MeshCat's cylinder from its y axis to z."""
_LUMINANCE = np.array([0.299, 0.587, 0.114])
_DARK, _LIFT = 0.4, 0.35
"""Luminance below which colours of shapes are lightened, as the background is dark, and the share
of white that black gets."""
_BACKGROUND = {"top_color": [0.10, 0.13, 0.20], "bottom_color": [0.02, 0.03, 0.05]}

Colour = Sequence[float]


@dataclass(frozen=True, eq=False)
class PageScene:
    """MeshCat commands of a scene and its description for the page."""

    objects: tuple[bytes, ...]  # commands that create the scene, as MessagePack
    copies: tuple[tuple[str, str], ...]  # pairs of paths; the second has the object of the first
    animation: bytes | None  # command with all tracks, as MessagePack; None without an animation
    description: SceneDescription  # titles, labels, colour scale and first view, for the page

    def commands(self) -> Iterator[dict[str, Any]]:
        """Yield MeshCat's commands, unpacked: the objects, their copies, the animation."""
        objects: dict[str, dict[str, Any]] = {}
        for packed in self.objects:
            command = umsgpack.unpackb(packed)
            if command["type"] == "set_object":
                objects[command["path"]] = command
            yield command
        for source, target in self.copies:
            yield objects[f"/{source}"] | {"path": f"/{target}"}
        if self.animation is not None:
            yield umsgpack.unpackb(self.animation)


class SceneBuilder:
    """Collects MeshCat commands; ``start`` is added to the times of the tracks that follow [s]."""

    def __init__(self) -> None:
        self.start = 0.0
        self._objects: list[bytes] = []
        self._tracks: dict[str, list[dict[str, Any]]] = {}
        self._copies: list[tuple[str, str]] = []
        self._known: dict[str, str] = {}
        for path in ("Grid", "Axes"):
            self._set(path, "visible", False)
        for key, value in _BACKGROUND.items():
            self._set("Background", key, value)
        for light in ("PointLightNegativeX", "PointLightPositiveX"):
            self._set(f"Lights/{light}/<object>", "distance", 0.0)
            self._set(f"Lights/{light}/<object>", "intensity", 0.25)

    def scene(self, description: SceneDescription) -> PageScene:
        """The scene; all clips have the duration of the description, else they freeze."""
        animation = None
        if self._tracks:
            duration = description.duration
            clips = [
                {"path": path, "clip": {"name": "default", "duration": duration, "tracks": tracks}}
                for path, tracks in self._tracks.items()
            ]
            options = {"play": False, "repetitions": 1}
            head = {"type": "set_animation", "path": ""}
            animation = bytes(umsgpack.packb({**head, "animations": clips, "options": options}))
        return PageScene(tuple(self._objects), tuple(self._copies), animation, description)

    def mesh(
        self,
        path: str,
        geometry: Any,
        colour: Colour,
        *,
        shaded: bool = True,
        overlay: bool = False,
        side: int = BOTH_SIDES,
    ) -> None:
        """Add a surface.

        Args:
            path: Path of the object.
            geometry: MeshCat geometry, or vertices (V, 3) and faces (F, 3).
            colour: Red, green, blue and opacity, in [0, 1].
            shaded: Whether lights affect the colour.
            overlay: Whether it is drawn over objects in front of it.
            side: Side that is visible; of the front the corners of faces run anticlockwise.
        """
        if isinstance(geometry, tuple):
            geometry = g.TriangularMeshGeometry(*geometry)
        red, green, blue, opacity = colour
        kind = g.MeshLambertMaterial if shaded else g.MeshBasicMaterial
        material = kind(
            color=int(to_hex((red, green, blue))[1:], 16), opacity=float(opacity),
            depthWrite=opacity == 1.0, depthTest=not overlay, reflectivity=0.0, side=side,
        )  # fmt: skip
        material.transparent = overlay or opacity < 1.0  # drawn last
        self._put(path, g.Mesh(geometry, material))

    def coloured_mesh(self, path: str, vertices: Array, faces: IntArray, colours: Array) -> None:
        """Add unshaded triangles (F, 3) with colours (V, 3) of the vertices (V, 3)."""
        geometry = g.TriangularMeshGeometry(vertices, faces, colours)
        material = g.MeshBasicMaterial(vertexColors=True, transparent=False, reflectivity=0.0)
        self._put(path, g.Mesh(geometry, material))

    def visual(self, path: str, visual: Visual) -> None:
        """Add a shape of a robot at its placement in the body."""
        shape = visual.shape
        at = visual.placement
        if isinstance(shape, Box):
            geometry = g.Box([float(edge) for edge in shape.size])
        elif isinstance(shape, Sphere):
            geometry = g.Sphere(float(shape.radius))
        elif isinstance(shape, Cylinder):
            geometry = g.Cylinder(float(shape.length), float(shape.radius))
            at = at @ _UPRIGHT
        else:
            geometry = g.TriangularMeshGeometry(shape.vertices, shape.faces)
        self.place(path, at)
        self.mesh(path, geometry, _lightened(visual.colour))

    def points(self, path: str, points: Array, colours: Array, size: float) -> None:
        """Add points (K, 3) with colours (K, 3) and a size [m]."""
        columns = (np.ascontiguousarray(array.T, np.float32) for array in (points, colours))
        self._put(path, g.Points(g.PointsGeometry(*columns), g.PointsMaterial(size=float(size))))

    def place(self, path: str, pose: Pose) -> None:
        """Set the pose of a path relative to its parent."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = pose.rotation, pose.position
        command = SetTransform(matrix, _path(path)).lower()
        command["matrix"] = [float(value) for value in command["matrix"]]
        self._objects.append(umsgpack.packb(command))

    def move(self, path: str, times: Array, positions: Array, quaternions: Array) -> None:
        """Animate a path: positions (K, 3) and quaternions x, y, z, w (K, 4) at times (K,).

        Until the animation is played, it is in the first pose.
        """
        self.place(path, Pose(positions[0], rotation_matrix(quaternions[0])))
        self._track(path, "position", "vector3", times, _floats(positions))
        self._track(path, "quaternion", "quaternion", times, _floats(quaternions))

    def appear(self, path: str, time: float) -> None:
        """Hide a path before a time [s]."""
        if time > 0.0:
            self._track(path, "visible", "boolean", np.array([0.0, time]), [False, True])

    def _set(self, path: str, key: str, value: Any) -> None:
        """Set a property of a path, or of its object if the path ends in ``<object>``."""
        self._objects.append(umsgpack.packb(SetProperty(key, value, _path(path)).lower()))

    def _track(self, path: str, name: str, kind: str, times: Array, values: Any) -> None:
        shifted = _floats(times + self.start)
        track = {"name": f".{name}", "type": kind, "times": shifted, "values": values}
        self._tracks.setdefault(_path(path).lower(), []).append(track)

    def _put(self, path: str, item: Any) -> None:
        """Add an object, or a copy of an equal object that was added before."""
        parts = item, item.geometry, item.material
        for part in parts:
            part.uuid = ""  # MeshCat assigns random ones
        content = sha256(umsgpack.packb(item.lower())).hexdigest()
        if content in self._known:
            self._copies.append((self._known[content], path))
            return
        for number, part in enumerate(parts):
            part.uuid = f"{len(self._known)}-{number}"
        self._known[content] = path
        self._objects.append(umsgpack.packb(SetObject(item, path=_path(path)).lower()))


def node(name: str) -> str:
    """A name as a single node of a path, its slashes replaced."""
    return name.replace("/", "∕").strip() or "unnamed"


def _lightened(colour: Colour) -> Colour:
    """Mix white into a dark colour."""
    rgb = np.asarray(colour[:3])
    white = _LIFT * max(0.0, 1.0 - float(_LUMINANCE @ rgb) / _DARK)
    return (*(rgb + white * (1.0 - rgb)), colour[3])


def _path(path: str) -> Path:
    return Path(tuple(part for part in path.split("/") if part))


def _floats(values: Array) -> Any:
    return umsgpack.Ext(_FLOAT32, np.ascontiguousarray(values, dtype="<f4").tobytes())
