"""A body beside the robot: its shape and how it moves."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, NamedTuple, Protocol

import numpy as np

from freefloat.errors import InputError, finite_vector, require_type
from freefloat.robot.description import IDENTITY, Link, LinkShape, RobotDescription
from freefloat.robot.named_files import find_robot, is_file
from freefloat.robot.shapes import Box, Cylinder, MeshFile, Sphere
from freefloat.robot.validation import read_urdf
from freefloat.scene.tumbling import Tumbling
from freefloat.so3 import Array, Pose, attitude_axes, frozen, zeros

Shape = Box | Cylinder | Sphere | MeshFile | RobotDescription
_SHAPES = "a Box, Sphere, Cylinder or MeshFile, or the name of a mesh file or a URDF"
_MESHES = (".stl", ".obj", ".dae", ".ply", ".off", ".gltf", ".glb")


def _unit() -> Array:
    return np.eye(3)


class SceneFrame(Protocol):
    """The frame in which a scene is stated."""

    def origin(self, t: float | Array) -> Array:
        """Origin of the frame at times t [s] relative to the centre of mass [m], shape (..., 3)."""


class EndEffectorPoses(NamedTuple):
    """Poses of the end-effector relative to the centre of mass, inertial axes."""

    prescribed: Pose  # what is prescribed, of which tasks may leave a part free
    actual: Pose  # the pose that the end-effector has, with which a held body moves

    @classmethod
    def on(cls, pose: Pose) -> EndEffectorPoses:
        """Poses of an end-effector that has the prescribed pose."""
        return cls(pose, pose)


@dataclass(frozen=True, eq=False)
class SceneBody:
    """A body beside the robot: fixed, tumbling, moving with the target of the path, or held.

    Attributes:
        name: Name of the body, which no other body and no link of the robot has.
        shape: A box, sphere, cylinder or mesh; or the name of a file, of a mesh in metres or of a
            URDF, whose joints are all fixed at zero.
        position: Position of its frame at time zero [m], shape (3,): in the path's frame, whose
            origin is the system's centre of mass at time zero; of a body that moves with the target
            in the end-effector's prescribed frame.
        orientation: Orientation of its frame at time zero in the same axes: axes as columns,
            shape (3, 3), or a quaternion x, y, z, w; kept as a matrix.
        motion: ``"fixed"`` in the path's frame; with the ``"target"``, the pose that the path
            prescribes for the end-effector (of tasks without orientation: its position); or a
            torque-free rotation.
        touch_links: Links of the robot that may touch it.
        payload: Link of the robot, without shape, that has the mass of the body, which is held.

    Raises:
        InputError: If a value is of another kind, or a file cannot be read.

    Example:
        >>> client = ff.SceneBody("client", ff.Box([1.0, 1.0, 2.0]), position=[3.0, 0.0, 0.0])
        >>> client.pose.position
        array([3., 0., 0.])
    """

    name: str
    shape: Shape = field(repr=False)
    position: Array = field(default_factory=zeros)
    orientation: Array = field(default_factory=_unit, repr=False)
    motion: Literal["fixed", "target"] | Tumbling = "fixed"
    touch_links: tuple[str, ...] = ()
    payload: str | None = None

    def __post_init__(self) -> None:
        require_type("body.name", self.name, str, "a name")
        if not self.name.strip():
            raise InputError("body.name", f"{self.name!r} was given", "a name")
        if isinstance(self.touch_links, str) or not isinstance(self.touch_links, Iterable):
            problem = f"{self.touch_links!r} was given"
            raise InputError("body.touch_links", problem, "a list of names of links")
        values = {
            "shape": _checked_shape("body.shape", self.shape),
            "position": frozen(finite_vector("body.position", self.position, 3)),
            "orientation": attitude_axes("body.orientation", self.orientation),
            "touch_links": tuple(self.touch_links),
        }
        for key, value in values.items():
            object.__setattr__(self, key, value)
        if not isinstance(self.motion, str) or self.motion not in ("fixed", "target"):
            accepted = "'fixed', 'target', or a Tumbling"
            require_type("body.motion", self.motion, Tumbling, accepted)
        require_type("body.payload", self.payload, str | None, "the name of a link")

    @property
    def pose(self) -> Pose:
        """The body's frame at time zero, see ``position``."""
        return Pose(self.position, self.orientation)

    def pose_at(
        self, t: float | Array, frame: SceneFrame, end_effector: EndEffectorPoses | None = None
    ) -> Pose:
        """The body's frame at time t [s] relative to the centre of mass, inertial axes.

        Args:
            t: Time [s], or times (K,) of one sign, at which it has K poses.
            frame: The frame in which the scene is stated.
            end_effector: Poses of the end-effector, needed where the body moves with it.

        Raises:
            InputError: If they are needed and missing.
        """
        if self.motion == "target":
            if end_effector is None:
                raise InputError("end_effector", "it is missing", "the poses of the end-effector")
            held = self.payload is not None
            return (end_effector.actual if held else end_effector.prescribed) @ self.pose
        pose = self._turned(t)
        return Pose(pose.position + frame.origin(t), pose.rotation)

    def _turned(self, t: float | Array) -> Pose:
        """The body's frame at times t [s] in the path's frame, unless it moves with the target."""
        if isinstance(self.motion, str):
            return Pose(self.position, np.broadcast_to(self.orientation, (*np.shape(t), 3, 3)))
        com, turned = self.motion.com, self.motion.rotation(t)
        return self.pose @ Pose(com - turned @ com, turned)

    def later(self, t: float, offset: Array) -> SceneBody:
        """The body with time t [s] as time zero, moved by an offset [m], shape (3,).

        One that moves with the target stays as it is.
        """
        if self.motion == "target":
            return self
        pose, motion = self._turned(t), self.motion
        if isinstance(motion, Tumbling):
            motion = replace(motion, rate=motion.angular_velocity(t))
        return replace(
            self, position=pose.position + offset, orientation=pose.rotation, motion=motion
        )

    @property
    def source(self) -> str:
        """File that the names of the body's meshes are relative to."""
        return self.shape.file if isinstance(self.shape, RobotDescription) else ""

    def shapes(self, kind: Literal["visual", "collision"]) -> tuple[LinkShape, ...]:
        """The body's shapes in its frame, as they are drawn or for collisions.

        A link of a URDF without shapes of one kind has the shapes of the other kind.
        """
        if not isinstance(self.shape, RobotDescription):
            return (LinkShape(kind, IDENTITY, self.shape, None, 1),)
        shapes: list[LinkShape] = []
        for link, pose in _link_poses(self.shape):
            chosen = [shape for shape in link.shapes if shape.kind == kind] or link.shapes
            shapes += (replace(shape, origin=pose @ shape.origin) for shape in chosen)
        return tuple(shapes)


def _link_poses(description: RobotDescription) -> Iterator[tuple[Link, Pose]]:
    """The links of a URDF and their poses in the frame of the first one, all joints at zero."""
    queue = [(description.roots[0], IDENTITY)]
    for name, pose in queue:
        yield description.links_by_name[name], pose
        queue += [
            (joint.child, pose @ joint.origin) for joint in description.children.get(name, ())
        ]


def _checked_shape(key: str, shape: object) -> Shape:
    """The shape with absolute file names; the shape of a file for the name of the file."""
    if isinstance(shape, str | Path):
        if not str(shape).lower().endswith(_MESHES):
            return read_urdf(find_robot(str(shape), Path()), mounted=True)
        if not is_file(Path(shape)):
            raise InputError(key, f"{shape}: no such file", "a mesh file")
        shape = MeshFile(str(shape))
    if isinstance(shape, MeshFile):
        return replace(shape, filename=os.path.abspath(shape.filename))
    require_type(key, shape, Box | Cylinder | Sphere | RobotDescription, _SHAPES)
    for name, count in (("size", 3), ("radius", 1), ("length", 1)):
        if hasattr(shape, name):
            lengths = finite_vector(f"{key}.{name}", np.ravel(getattr(shape, name)), count)
            if lengths.min() <= 0.0:
                problem = f"{lengths.tolist()} was given"
                raise InputError(f"{key}.{name}", problem, "positive lengths [m]")
    return shape  # type: ignore[return-value]
