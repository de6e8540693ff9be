"""Rotations as arrays, with the interface of SciPy's ``Rotation``, whose import takes longer."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def rotation_matrix(quaternion: npt.ArrayLike) -> Array:
    """Rotations (..., 3, 3) of quaternions x, y, z, w of any length but zero, shape (..., 4)."""
    q = np.asarray(quaternion, dtype=float)
    x, y, z, w = q.tolist() if q.ndim == 1 else np.moveaxis(q, -1, 0)
    k = 2.0 / (x * x + y * y + z * z + w * w)
    xx, yy, zz, xy, yz, zx = k * x * x, k * y * y, k * z * z, k * x * y, k * y * z, k * z * x
    wx, wy, wz = k * w * x, k * w * y, k * w * z
    rotations = np.array([
        [1.0 - yy - zz, xy - wz, zx + wy],
        [xy + wz, 1.0 - zz - xx, yz - wx],
        [zx - wy, yz + wx, 1.0 - xx - yy],
    ])  # fmt: skip
    return rotations if q.ndim == 1 else np.moveaxis(rotations, (0, 1), (-2, -1))


@dataclass(frozen=True, eq=False)
class Rotation:
    """One rotation or many, of any shape; operations broadcast."""

    quaternions: Array  # unit quaternions x, y, z, w, (..., 4)

    @classmethod
    def from_quat(cls, quaternions: npt.ArrayLike) -> Rotation:
        """Rotations of quaternions x, y, z, w of any length but zero, shape (..., 4)."""
        values = np.asarray(quaternions, dtype=float)
        return cls(values / np.linalg.norm(values, axis=-1, keepdims=True))

    @classmethod
    def from_matrix(cls, matrices: npt.ArrayLike) -> Rotation:
        """Rotations of orthogonal matrices, shape (..., 3, 3).

        The largest of the four components of a quaternion decides the division (Shepperd 1978).
        """
        R = np.asarray(matrices, dtype=float)
        diagonal = np.diagonal(R, axis1=-2, axis2=-1)
        trace = diagonal.sum(axis=-1)
        squares = np.concatenate([2.0 * diagonal - trace[..., None], trace[..., None]], axis=-1)
        products = np.empty((*trace.shape, 4, 4))
        products[..., range(4), range(4)] = 1.0 + squares
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            products[..., i, j] = products[..., j, i] = R[..., i, j] + R[..., j, i]
            products[..., k, 3] = products[..., 3, k] = R[..., j, i] - R[..., i, j]
        largest = squares.argmax(axis=-1)[..., None, None]
        return cls.from_quat(np.take_along_axis(products, largest, axis=-2)[..., 0, :])

    @classmethod
    def from_rotvec(cls, vectors: npt.ArrayLike) -> Rotation:
        """Rotations by rotation vectors [rad], shape (..., 3)."""
        v = np.asarray(vectors, dtype=float)
        angle = np.linalg.norm(v, axis=-1, keepdims=True)
        return cls(np.concatenate([np.sinc(angle / math.tau) / 2.0 * v, np.cos(angle / 2.0)], -1))

    @classmethod
    def from_rpy(cls, angles: npt.ArrayLike) -> Rotation:
        """Rotations by roll, pitch and yaw [rad] about the fixed axes x, y, z, shape (..., 3)."""
        roll, pitch, yaw = (
            cls.from_rotvec(np.multiply.outer(angle, axis))
            for angle, axis in zip(np.moveaxis(np.asarray(angles), -1, 0), np.eye(3), strict=True)
        )
        return yaw * pitch * roll

    def as_quat(self) -> Array:
        """Unit quaternions x, y, z, w, shape (..., 4)."""
        return self.quaternions.copy()

    def as_matrix(self) -> Array:
        """Orthogonal matrices, shape (..., 3, 3)."""
        return rotation_matrix(self.quaternions)

    def as_rotvec(self) -> Array:
        """Shortest rotation vectors [rad], shape (..., 3)."""
        q = np.where(self.quaternions[..., 3:] < 0.0, -self.quaternions, self.quaternions)
        half = np.arctan2(np.linalg.norm(q[..., :3], axis=-1, keepdims=True), q[..., 3:])
        return np.asarray(2.0 / np.sinc(half / math.pi) * q[..., :3])

    def as_rpy(self) -> Array:
        """Roll, pitch and yaw [rad] about the fixed axes x, y, z, shape (..., 3).

        Where the pitch is a right angle, the roll is zero.
        """
        R = self.as_matrix()
        level = np.hypot(R[..., 0, 0], R[..., 1, 0])
        upright = level < 1e-7
        roll = np.where(upright, 0.0, np.arctan2(R[..., 2, 1], R[..., 2, 2]))
        sine = np.where(upright, -R[..., 0, 1], R[..., 1, 0])
        yaw = np.arctan2(sine, np.where(upright, R[..., 1, 1], R[..., 0, 0]))
        return np.stack([roll, np.arctan2(-R[..., 2, 0], level), yaw], axis=-1)

    def inv(self) -> Rotation:
        """The inverse rotations."""
        return Rotation(self.quaternions * [-1.0, -1.0, -1.0, 1.0])

    def __mul__(self, inner: Rotation) -> Rotation:
        """Rotations by ``inner`` and then by these."""
        (u, s), (v, t) = ((r.quaternions[..., :3], r.quaternions[..., 3:]) for r in (self, inner))
        vector = s * v + t * u + np.cross(u, v)
        scalar = s * t - (u * v).sum(axis=-1, keepdims=True)
        return Rotation.from_quat(np.concatenate([vector, scalar], axis=-1))

    def __getitem__(self, index: int | slice | Array) -> Rotation:
        """Some of the rotations."""
        return Rotation(self.quaternions[index])

    def apply(self, vectors: npt.ArrayLike) -> Array:
        """Rotated vectors, shape (..., 3)."""
        return np.asarray(np.einsum("...ij,...j->...i", self.as_matrix(), np.asarray(vectors)))
