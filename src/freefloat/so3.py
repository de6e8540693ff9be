r"""Frame and sign conventions; attitudes, rotations and poses.

* The inertial origin is the system's centre of mass. It never moves.
* A quaternion is Hamilton's, ordered ``x, y, z, w``. It rotates spacecraft-frame vectors into the
  inertial frame: Pinocchio's order and sense for a free-flyer root, and (8c) of the paper.
* A twist is ``[linear; angular]``. End-effector twists are inertial (axes of the inertial frame, at
  the end-effector); the base twist is in the spacecraft frame.
* Angular momentum ``h`` is about the centre of mass, in inertial axes.
* A heading is the angle of a planar spacecraft about the normal of its plane.
* SI units and radians everywhere; degrees exist only in files and options whose name says so.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.errors import InputError, finite_vector, number_array
from freefloat.rotations import Rotation, rotation_matrix

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

_ORTHOGONALITY = 1e-6  # largest deviation of the products of a rotation's columns
NORM_ERROR = 0.01
"""Deviation of a quaternion's norm from one that is accepted."""


def frozen(values: npt.ArrayLike) -> Array:
    """A read-only float copy of an array, for the fields of records."""
    array = np.array(values, dtype=float)
    array.setflags(write=False)
    return array


UPRIGHT = frozen([0.0, 0.0, 0.0, 1.0])
"""The attitude of a spacecraft whose axes are the inertial ones."""


def zeros() -> Array:
    """The zero vector, shape (3,): default of fields of records."""
    return frozen(np.zeros(3))


@dataclass(frozen=True, eq=False)
class Pose:
    """Pose of a frame relative to another one, or K poses, such as poses at K times.

    Attributes:
        position: Origin of the frame in the other frame [m], shape (3,) or (K, 3).
        rotation: Rotates vectors of the frame into the other one, shape (3, 3) or (K, 3, 3).
    """

    position: Array
    rotation: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", frozen(self.position))
        object.__setattr__(self, "rotation", frozen(self.rotation))

    @classmethod
    def of(cls, key: str, value: Any, accepted: str = "so3.Pose(position, rotation)") -> Pose:
        """A pose as it is given, or one of Pinocchio (``pin.SE3``).

        Raises:
            InputError: Naming ``key``, for anything else, or if it has no position or rotation.
        """
        try:
            pose = value if isinstance(value, cls) else cls(value.translation, value.rotation)
        except AttributeError:
            problem = f"{type(value).__name__} was given"
            raise InputError(key, problem, f"{accepted}, or a pin.SE3") from None
        finite_vector(f"{key}.position", pose.position, 3)
        attitude_axes(f"{key}.rotation", pose.rotation)
        return pose

    def __repr__(self) -> str:
        position, quaternion = (np.round(x, 9) + 0.0 for x in (self.position, self.quaternion))
        return f"Pose(position={position.tolist()}, quaternion={quaternion.tolist()})"

    def __getitem__(self, number: int) -> Pose:
        """One of K poses."""
        return Pose(self.position[number], self.rotation[number])

    @property
    def quaternion(self) -> Array:
        """The rotation as a unit quaternion x, y, z, w with w of at least zero, shape (..., 4)."""
        quaternion = Rotation.from_matrix(self.rotation).as_quat()
        return np.where(quaternion[..., 3:] < 0.0, -quaternion, quaternion)

    def __matmul__(self, inner: Pose) -> Pose:
        """The composition with the pose ``inner`` relative to this frame."""
        position = self.position + turned(self.rotation, inner.position)
        return Pose(position, self.rotation @ inner.rotation)

    def inverse(self) -> Pose:
        """The pose of the other frame relative to this one."""
        back = self.rotation.swapaxes(-1, -2)
        return Pose(-turned(back, self.position), back)

    def seen_from(self, rotation: Array) -> Pose:
        """The pose relative to a frame with the same origin, rotated by ``rotation`` (3, 3)."""
        return Pose(rotation.T @ self.position, rotation.T @ self.rotation)

    def seen_from_each(self, attitudes: Array) -> tuple[Array, Array]:
        """Positions (K, 3) and rotations (K, 3, 3) relative to frames with attitudes (K, 4)."""
        back = rotation_matrix(attitudes).swapaxes(1, 2)
        # bit for bit the same for any number of frames, as no product of one large matrix is
        position = np.einsum("kij,j->ki", back, self.position)
        return position, np.einsum("kij,jl->kil", back, self.rotation)


def unit_vector(key: str, values: npt.ArrayLike) -> Array:
    """A normalized direction, shape (3,).

    Raises:
        InputError: Naming ``key``, for the zero vector and for anything but finite numbers.
    """
    vector = finite_vector(key, values, 3)
    largest = np.abs(vector).max()
    if largest == 0.0:
        raise InputError(key, "the zero vector has no direction", "a vector of nonzero length")
    scaled = vector / largest
    return np.asarray(scaled / np.linalg.norm(scaled))


def unit_quaternion(key: str, values: npt.ArrayLike) -> Array:
    """A normalized quaternion ``x, y, z, w``, shape (4,).

    Raises:
        InputError: Naming ``key``, if the norm differs from one by more than one percent.
    """
    quaternion = finite_vector(key, values, 4)
    with np.errstate(over="ignore"):  # an infinite norm is refused, too
        norm = float(np.linalg.norm(quaternion))
    if abs(norm - 1.0) > NORM_ERROR:
        raise InputError(key, f"norm {norm:.4g} was given", "a unit quaternion x, y, z, w")
    return quaternion / norm


def attitude_axes(key: str, values: npt.ArrayLike) -> Array:
    """The rotation (3, 3) of an attitude, read-only.

    The values are axes as columns, shape (3, 3), or a quaternion x, y, z, w as accepted by
    :func:`unit_quaternion`.

    Raises:
        InputError: Naming ``key``, if they are neither, or the axes differ from a right-handed
            rotation by more than 1e-6.
    """
    accepted = "a rotation, shape (3, 3), or a unit quaternion x, y, z, w"
    array = frozen(number_array(key, values, accepted))
    if array.shape == (4,):
        return frozen(rotation_matrix(unit_quaternion(key, array)))
    if array.shape != (3, 3) or not np.isfinite(array).all():
        raise InputError(key, f"{array.tolist()} was given", accepted)
    error = float(np.abs(array.T @ array - np.eye(3)).max())
    determinant = float(np.linalg.det(array))
    if error > _ORTHOGONALITY or determinant < 0.0:
        problem = (
            f"its columns deviate by {error:.3g} from orthonormal, determinant {determinant:.3g}"
        )
        raise InputError(key, problem, accepted)
    return array


def components(vectors: Array) -> Any:
    """Components of a vector as floats, components of K vectors (K, c) as arrays (K,)."""
    return vectors.tolist() if vectors.ndim == 1 else vectors.T


def cross(u: Array, v: Array) -> Array:
    """The vector product of vectors (3,) or (K, 3), in a fifth of ``np.cross``'s time."""
    (a, b, c), (x, y, z) = components(u), components(v)
    return np.array([b * z - c * y, c * x - a * z, a * y - b * x]).T


def turned(rotations: Array, vectors: Array) -> Array:
    """Products of rotations, or other matrices (..., r, c), and vectors (..., c), (..., r)."""
    if rotations.ndim == 2 and vectors.ndim == 1:
        return np.asarray(rotations.dot(vectors))
    return np.asarray((rotations @ vectors[..., None])[..., 0])


def wrapped(angles: npt.ArrayLike) -> Array:
    """Angles [rad] in [-pi, pi)."""
    return np.asarray(np.add(angles, np.pi) % (2.0 * np.pi) - np.pi)


def heading_quaternion(heading: npt.ArrayLike, normal: npt.ArrayLike = (0.0, 0.0, 1.0)) -> Array:
    """Attitudes ``x, y, z, w``, (..., 4), of a planar spacecraft with headings [rad] (...).

    They are rotations about the normal of its plane, (3,).
    """
    half = np.asarray(heading, dtype=float)[..., None] / 2.0
    return np.concatenate([np.sin(half) * normal + 0.0, np.cos(half)], axis=-1)


def heading_of(attitude: npt.ArrayLike, normal: npt.ArrayLike = (0.0, 0.0, 1.0)) -> float:
    """The heading [rad] in [0, 2 pi) of an attitude ``x, y, z, w`` about a normal, (3,)."""
    values = np.asarray(attitude, dtype=float)
    heading = float(2.0 * np.arctan2(values[:3] @ np.asarray(normal), values[3]) % (2.0 * np.pi))
    return heading if heading < 2.0 * np.pi else 0.0  # a tiny negative angle rounds up


def axis_frame(axis: Array) -> Array:
    """A rotation (3, 3) whose third column is a unit vector (3,)."""
    x = np.cross(np.eye(3)[np.abs(axis).argmin()], axis)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])


def axes_rotation(
    key: str, exact: tuple[str, npt.ArrayLike], other: tuple[str, npt.ArrayLike]
) -> Array:
    """The right-handed rotation (3, 3) with two axes in given directions.

    Args:
        key: Named in errors.
        exact: Letter of an axis (``x``, ``y`` or ``z``) and its direction.
        other: Letter of another axis and a direction, which is made orthogonal to the first.

    Raises:
        InputError: If the directions are parallel or the letters are equal.
    """
    i, j = "xyz".index(exact[0]), "xyz".index(other[0])
    if i == j:
        raise InputError(key, f"axis {exact[0]} was given twice", "two different axes of x, y, z")
    first = unit_vector(f"{key}.{exact[0]}", exact[1])
    second = unit_vector(f"{key}.{other[0]}", other[1])
    across = second - first * (first @ second)
    if np.linalg.norm(across) < 1e-6:
        problem = f"axes {exact[0]} and {other[0]} are parallel"
        raise InputError(key, problem, "two directions that are not parallel")
    columns = np.empty((3, 3))
    columns[:, i] = first
    columns[:, j] = across / np.linalg.norm(across)
    k = 3 - i - j
    columns[:, k] = np.cross(columns[:, (k + 1) % 3], columns[:, (k + 2) % 3])
    return columns


def rotated(attitudes: npt.ArrayLike, rotation_vectors: npt.ArrayLike) -> Array:
    """Attitudes x, y, z, w rotated by inertial rotation vectors [rad], shape (K, 4)."""
    q = Rotation.from_quat(np.atleast_2d(attitudes))
    return np.asarray((Rotation.from_rotvec(np.atleast_2d(rotation_vectors)) * q).as_quat())


def rotated_in_body(attitude: Array, vector: Array) -> Array:
    """An attitude (4,) or (K, 4) rotated by a rotation vector of its body, (3,) or (K, 3) [rad]."""
    half = np.linalg.norm(vector, axis=-1) / 2.0
    p, q, r = components(vector * np.expand_dims(np.sinc(half / np.pi) / 2.0, -1))
    s = np.cos(half)
    x, y, z, w = components(attitude)
    return np.array([
        w * p + x * s + y * r - z * q,
        w * q - x * r + y * s + z * p,
        w * r + x * q - y * p + z * s,
        w * s - x * p - y * q - z * r,
    ]).T  # fmt: skip


def rotation_vector_between(start: npt.ArrayLike, end: npt.ArrayLike) -> Array:
    """The rotation vectors [rad] from rotations (3, 3) or (K, 3, 3) to others, (3,) or (K, 3)."""
    difference = np.asarray(end) @ np.asarray(start).swapaxes(-1, -2)
    return np.asarray(Rotation.from_matrix(difference).as_rotvec())


def rotation_vector_to(start: npt.ArrayLike, end: npt.ArrayLike) -> Array:
    """The shortest inertial rotation vectors [rad] between attitudes x, y, z, w, shape (K, 3)."""
    ends = Rotation.from_quat(np.atleast_2d(end))
    return np.asarray((ends * Rotation.from_quat(np.atleast_2d(start)).inv()).as_rotvec())


def angle_between(a: npt.ArrayLike, b: npt.ArrayLike) -> Array:
    """Angles [rad] between attitudes x, y, z, w and others, broadcast over leading axes."""
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    sine = np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1)) / 2.0
    return np.asarray(4.0 * np.arcsin(np.minimum(sine, 1.0)))


def without_jumps(attitudes: Array) -> Array:
    """Unit quaternions (K, 4) with the signs for which neighbours are near."""
    along = (attitudes[1:] * attitudes[:-1]).sum(axis=1)
    signs = np.cumprod(np.append(1.0, np.where(along < 0.0, -1.0, 1.0)))
    return np.asarray(signs[:, None] * attitudes)


def degrees(angle: float | None) -> float | None:
    """An angle [rad] in degrees; None for None."""
    return None if angle is None else float(np.degrees(angle))
