r"""The conventions, stated once, and the few attitude helpers that follow from them.

* The inertial origin is the system's centre of mass. It never moves.
* A quaternion is Hamilton's, ordered ``x, y, z, w``. It turns spacecraft-frame vectors into the
  inertial frame: Pinocchio's order and sense for a free-flyer root, and (8c) of the paper.
* A twist is ``[linear; angular]``. End-effector twists are inertial (axes of the inertial frame, at
  the end-effector); the base twist is in the spacecraft frame.
* Angular momentum ``h`` is about the centre of mass, in inertial axes.
* A heading is the angle of a planar spacecraft about the inertial z axis.
* SI units and radians everywhere; degrees exist only in files and options whose name says so.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from freefloat.errors import InputError

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


def frozen(values: npt.ArrayLike) -> Array:
    """A read-only float copy of an array, for the fields of records."""
    array = np.array(values, dtype=float)
    array.setflags(write=False)
    return array


@dataclass(frozen=True, eq=False)
class Pose:
    """Where a frame is.

    Attributes:
        position: Its origin in the other frame [m], shape (3,).
        rotation: Turns its own vectors into the other frame, shape (3, 3).
    """

    position: Array
    rotation: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", frozen(self.position))
        object.__setattr__(self, "rotation", frozen(self.rotation))

    def __matmul__(self, inner: Pose) -> Pose:
        """The pose, seen from outside, of what stands at ``inner`` in this frame."""
        position = self.position + self.rotation @ inner.position
        return Pose(position, self.rotation @ inner.rotation)

    def seen_from(self, rotation: Array) -> Pose:
        """The same pose in a frame with the same origin, turned by ``rotation`` (3, 3)."""
        return Pose(rotation.T @ self.position, rotation.T @ self.rotation)


def finite_vector(key: str, values: npt.ArrayLike, length: int) -> Array:
    """Check that ``values`` are ``length`` finite numbers.

    Raises:
        InputError: Naming ``key`` when they are not.
    """
    accepted = f"{length} finite numbers"
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise InputError(key, f"{values!r} is not a list of numbers", accepted) from None
    if array.shape != (length,) or not np.isfinite(array).all():
        raise InputError(key, f"{array.tolist()} was given", accepted)
    return array


def finite_number(key: str, value: object, accepted: str) -> float:
    """Check that ``value`` is a finite number; whole numbers become floats like any other.

    Raises:
        InputError: Naming ``key`` and what is ``accepted`` when it is not.
    """
    if not isinstance(value, int | float | np.integer | np.floating) or not np.isfinite(value):
        raise InputError(key, f"{value!r} was given", accepted)
    return float(value)


def whole_number(key: str, value: object, least: int) -> int:
    """Check that ``value`` is a whole number, ``least`` or more; 64.0 is none.

    Raises:
        InputError: Naming ``key`` when it is not.
    """
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise InputError(key, f"{value!r} was given", f"a whole number, {least} or more")
    if value < least:
        raise InputError(key, f"{value} was given", f"{least} or more")
    return int(value)


def unit_vector(key: str, values: npt.ArrayLike) -> Array:
    """A direction, normalized; refused when it has none."""
    vector = finite_vector(key, values, 3)
    largest = np.abs(vector).max()
    if largest == 0.0:
        raise InputError(key, "the zero vector has no direction", "a vector of nonzero length")
    scaled = vector / largest
    return np.asarray(scaled / np.linalg.norm(scaled))


def unit_quaternion(key: str, values: npt.ArrayLike) -> Array:
    """A quaternion ``x, y, z, w``, normalized.

    Values printed with a few digits are welcome; a quaternion whose norm is off by more than one
    percent is more likely a mistake and is refused.
    """
    quaternion = finite_vector(key, values, 4)
    norm = float(np.linalg.norm(quaternion))
    if abs(norm - 1.0) > 0.01:
        raise InputError(key, f"norm {norm:.4g} was given", "a unit quaternion x, y, z, w")
    return quaternion / norm


def attitude_axes(key: str, values: npt.ArrayLike) -> Array:
    """The axes of an attitude, told by themselves or by a quaternion.

    Args:
        key: Named in errors.
        values: Axes as columns, shape (3, 3), or a quaternion x, y, z, w, shape (4,), taken as by
            :func:`unit_quaternion`.

    Returns:
        Shape (3, 3), read-only; axes are as they were given.

    Raises:
        InputError: If it is neither, or axes are no right-handed rotation to a millionth.
    """
    accepted = "a rotation, shape (3, 3), or a unit quaternion x, y, z, w"
    try:
        array = frozen(values)
    except (TypeError, ValueError):
        raise InputError(key, f"{values!r} was given", accepted) from None
    if array.shape == (4,):
        return frozen(rotation_matrix(unit_quaternion(key, array)))
    if array.shape != (3, 3):
        raise InputError(key, f"an array of shape {array.shape} was given", accepted)
    if not np.isfinite(array).all():
        raise InputError(key, f"{array.tolist()} was given", accepted)
    off, hand = float(np.abs(array.T @ array - np.eye(3)).max()), float(np.linalg.det(array))
    if off > _SKEW:
        problem = f"its columns are not square to each other and of length 1, off by {off:.3g}"
        raise InputError(key, problem, accepted)
    if hand < 0.0:
        raise InputError(key, f"it is left-handed, its determinant is {hand:.3g}", accepted)
    return array


_SKEW = 1e-6
"""By how much products of axes may differ from those of a rotation."""


def cross(u: Array, v: Array) -> Array:
    """The vector product of two vectors (3,), in a fifth of ``np.cross``'s time."""
    (a, b, c), (x, y, z) = u.tolist(), v.tolist()
    return np.array([b * z - c * y, c * x - a * z, a * y - b * x])


def rotation_matrix(quaternion: npt.ArrayLike) -> Array:
    """The rotation (3, 3) that a quaternion ``x, y, z, w`` stands for."""
    return np.asarray(Rotation.from_quat(quaternion).as_matrix())


def quaternion(rotation: npt.ArrayLike) -> Array:
    """The quaternion ``x, y, z, w`` of a rotation (3, 3), with the sign scipy chooses."""
    return np.asarray(Rotation.from_matrix(rotation).as_quat())


def heading_quaternion(heading: float) -> Array:
    """The attitude ``x, y, z, w`` of a planar spacecraft with a heading [rad]."""
    return np.array([0.0, 0.0, np.sin(heading / 2), np.cos(heading / 2)])


def heading_of(attitude: npt.ArrayLike) -> float:
    """The heading [rad] in [0, 2 pi) of an attitude ``x, y, z, w`` that turns about z alone."""
    z, w = np.asarray(attitude, dtype=float)[2:]
    heading = float(2.0 * np.arctan2(z, w) % (2.0 * np.pi))
    return heading if heading < 2.0 * np.pi else 0.0  # a tiny negative angle rounds up


def rotation_angle(rotation: npt.ArrayLike) -> float:
    """The angle [rad] by which a rotation (3, 3) turns, in [0, pi]."""
    return float(Rotation.from_matrix(rotation).magnitude())


def axes_rotation(
    key: str, kept: tuple[str, npt.ArrayLike], bent: tuple[str, npt.ArrayLike]
) -> Array:
    """The rotation whose columns are given by two named axes.

    Args:
        key: Named in errors.
        kept: Letter of an axis (``x``, ``y`` or ``z``) and the direction it points to, kept.
        bent: Another axis and its direction, made orthogonal to the first.

    Returns:
        Rotation of shape (3, 3), right-handed.

    Raises:
        InputError: If the directions are parallel or the letters are equal.
    """
    i, j = "xyz".index(kept[0]), "xyz".index(bent[0])
    if i == j:
        raise InputError(key, f"axis {kept[0]} was given twice", "two different axes of x, y, z")
    first = unit_vector(f"{key}.{kept[0]}", kept[1])
    second = unit_vector(f"{key}.{bent[0]}", bent[1])
    across = second - first * (first @ second)
    if np.linalg.norm(across) < 1e-6:
        raise InputError(
            key,
            f"axes {kept[0]} and {bent[0]} are parallel",
            "two directions that are not parallel",
        )
    columns = np.empty((3, 3))
    columns[:, i] = first
    columns[:, j] = across / np.linalg.norm(across)
    k = 3 - i - j
    columns[:, k] = np.cross(columns[:, (k + 1) % 3], columns[:, (k + 2) % 3])
    return columns


def low_discrepancy(count: int, dimension: int) -> Array:
    """Evenly spread points of the unit cube, the same at every call: an additive recurrence.

    The steps are powers of the inverse of the ``dimension``-th generalized golden ratio.

    Returns:
        Shape (count, dimension), in [0, 1).
    """
    ratio = 2.0
    for _ in range(64):
        ratio = (1.0 + ratio) ** (1.0 / (dimension + 1))
    steps = ratio ** -np.arange(1.0, dimension + 1)
    return np.asarray((0.5 + np.outer(np.arange(count), steps)) % 1.0)


def rotation_vector_between(start: npt.ArrayLike, end: npt.ArrayLike) -> Array:
    """The rotation vector [rad] that turns one rotation (3, 3) into another, shape (3,).

    Of many pairs at once, shapes (K, 3, 3), there are as many, shape (K, 3).
    """
    turn = Rotation.from_matrix(np.asarray(end) @ np.asarray(start).swapaxes(-1, -2))
    return np.asarray(turn.as_rotvec())


_SPIRALS = (np.sqrt(2.0), 1.533751168755204288118041)  # the second solves x**4 = x + 4


def attitude_grid(count: int, seed: int = 0) -> Array:
    """Evenly spread attitudes, any number of them: super-Fibonacci spirals (Alexa, CVPR 2022).

    Every attitude stands for the same share of SO(3).

    Args:
        count: How many.
        seed: Turns the whole grid by a random rotation; 0 leaves it as it is.

    Returns:
        Unit quaternions x, y, z, w, shape (count, 4).
    """
    place = np.arange(count) + 0.5
    inner, outer = np.sqrt(place / count), np.sqrt(1.0 - place / count)
    first, second = (2.0 * np.pi * place / turn for turn in _SPIRALS)
    grid = np.column_stack([
        inner * np.sin(first), inner * np.cos(first), outer * np.sin(second), outer * np.cos(second)
    ])  # fmt: skip
    if seed == 0:
        return grid
    turn = Rotation.random(rng=np.random.default_rng(seed))
    return np.asarray((turn * Rotation.from_quat(grid)).as_quat())


def grid_spacing(count: int) -> float:
    """Side [rad] of a cube with the volume that each of ``count`` attitudes stands for."""
    return float((8.0 * np.pi**2 / count) ** (1.0 / 3.0))


def attitudes_within(center: npt.ArrayLike, radius: float, count: int, seed: int = 0) -> Array:
    """Attitudes evenly spread in a geodesic ball.

    Args:
        center: Quaternion x, y, z, w.
        radius: Largest angle from the center [rad], at most pi.
        count: How many.
        seed: Shifts the low-discrepancy sequence that they are made of.

    Returns:
        Unit quaternions x, y, z, w, shape (count, 4).
    """
    share, axes = _ball(count, seed)
    angles = np.linspace(0.0, radius, 257)
    volume = angles - np.sin(angles)  # of the ball with that angle, but for a factor
    half = np.interp(share * volume[-1], volume, angles)[:, None] / 2.0
    x, y, z, w = (np.asarray(center) / np.linalg.norm(center)).tolist()
    by_center = np.array([[w, -z, y, -x], [z, w, -x, -y], [-y, x, w, -z], [x, y, z, w]])
    return np.asarray(np.hstack([np.sin(half) * axes, np.cos(half)]) @ by_center)


@lru_cache(maxsize=256)
def _ball(count: int, seed: int) -> tuple[Array, Array]:
    """Shares of a ball's volume, shape (count,), and directions from its center, (count, 3)."""
    shift = np.random.default_rng(seed).random(3)
    share, height, around = ((low_discrepancy(count, 3) + shift) % 1.0).T
    z, azimuth = 2.0 * height - 1.0, 2.0 * np.pi * around
    ring = np.sqrt(np.maximum(0.0, 1.0 - z * z))
    return share, np.column_stack([ring * np.cos(azimuth), ring * np.sin(azimuth), z])


def turned(attitudes: npt.ArrayLike, turns: npt.ArrayLike) -> Array:
    """Attitudes x, y, z, w turned further by inertial rotation vectors [rad], shape (K, 4)."""
    q = Rotation.from_quat(np.atleast_2d(attitudes))
    return np.asarray((Rotation.from_rotvec(np.atleast_2d(turns)) * q).as_quat())


def rotation_vector_to(start: npt.ArrayLike, end: npt.ArrayLike) -> Array:
    """The shortest inertial rotation vectors [rad] from attitudes to others, shape (K, 3)."""
    ends = Rotation.from_quat(np.atleast_2d(end))
    return np.asarray((ends * Rotation.from_quat(np.atleast_2d(start)).inv()).as_rotvec())


def angle_between(a: npt.ArrayLike, b: npt.ArrayLike) -> Array:
    """Angles [rad] between attitudes x, y, z, w and others, broadcast over leading axes."""
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    sine = np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1)) / 2.0
    return np.asarray(4.0 * np.arcsin(np.minimum(sine, 1.0)))


def without_jumps(attitudes: Array) -> Array:
    """The signs of unit quaternions (K, 4) chosen so that neighbours are near."""
    along = (attitudes[1:] * attitudes[:-1]).sum(axis=1)
    signs = np.cumprod(np.append(1.0, np.where(along < 0.0, -1.0, 1.0)))
    return np.asarray(signs[:, None] * attitudes)


def breaks_triangle(moments: npt.ArrayLike) -> bool:
    """Whether no rigid body has these principal moments, ascending, shape (3,)."""
    least, middle, most = np.asarray(moments, dtype=float).tolist()
    return bool(least + middle < most * (1.0 - 1e-9))
