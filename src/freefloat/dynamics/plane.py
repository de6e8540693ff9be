"""The plane in which a planar robot moves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from freefloat.attitude_grids import low_discrepancy
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import (
    UPRIGHT,
    Array,
    axis_frame,
    frozen,
    heading_of,
    heading_quaternion,
    unit_quaternion,
)

_SAME_DIRECTION, _ROUNDED_DIRECTION = 1e-9, 1e-5
"""Differences between directions that are rounding errors: of numbers, of angles in files."""
_ROUNDED_PI = 1e-3
"""Largest angle between axes that are probably parallel, in a file with pi to few digits [rad]."""


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane through the centre of mass, the same one seen from spacecraft and inertial frame.

    Columns of the rotation ``axes`` (3, 3) are two directions in the plane and its normal.
    """

    axes: Array

    @classmethod
    def of_normal(cls, normal: Array) -> Plane:
        """The plane with a normal, shape (3,), whose largest component is positive."""
        normal = normal * np.sign(normal[np.abs(normal).argmax()])
        k = int(normal.argmax())
        if np.abs(normal - np.eye(3)[k]).max() < _SAME_DIRECTION:
            return cls(frozen(np.roll(np.eye(3), 2 - k, axis=1)))
        return cls(frozen(axis_frame(normal)))

    @property
    def normal(self) -> Array:
        """The direction about which headings count, shape (3,)."""
        return self.axes[:, 2]

    @property
    def is_level(self) -> bool:
        """Whether the plane is the x-y plane."""
        return bool(self.normal[2] == 1.0)

    @property
    def is_exact(self) -> bool:
        """Whether the plane's normal is a coordinate axis."""
        return bool(self.normal.max() == 1.0)

    @property
    def tolerance(self) -> float:
        """Sine of the largest angle between a direction and the plane that counts as none.

        With a normal that is no coordinate axis, it allows for angles rounded in files, as 1.5708.
        """
        return _SAME_DIRECTION if self.is_exact else _ROUNDED_DIRECTION

    @property
    def letters(self) -> str:
        """Letters of the coordinate axes that the plane's axes are; u, v and n if they are none."""
        return "".join("xyz"[i] for i in self.axes.argmax(axis=0)) if self.is_exact else "uvn"

    @property
    def axis(self) -> str:
        """The normal in words: the letter of a coordinate axis, or its components."""
        if self.is_exact:
            return self.letters[2]
        return f"({', '.join(f'{entry:.4g}' for entry in self.normal + 0.0)})"

    @property
    def about(self) -> str:
        """About which axis headings count, as words behind them, where it is not z."""
        return "" if self.is_level else f" about {self.axis}"

    @property
    def name(self) -> str:
        """The plane in words."""
        if self.is_exact:
            return f"{'-'.join(sorted(self.letters[:2]))} plane"
        return f"plane normal to {self.axis}"

    def seen(self, vectors: Array) -> Array:
        """Components of vectors (..., 3) along the plane's axes."""
        return vectors if self.is_level else np.asarray(vectors @ self.axes)

    def rows(self, twists: Array) -> Array:
        """Components of pairs of vectors in columns, shape (6 k, ...), along the plane's axes."""
        if self.is_level:
            return twists
        x, y, z = twists.reshape(len(twists) // 3, 3, *twists.shape[1:]).swapaxes(0, 1)
        axes = self.axes.T.astype(twists.dtype)
        # not a matrix product, whose rounding depends on the number of columns
        rows = [a * x + b * y + c * z for a, b, c in axes]
        return np.stack(rows, axis=1).reshape(twists.shape)

    def attitudes(self, headings: npt.ArrayLike) -> Array:
        """Attitudes ``x, y, z, w``, (..., 4), with headings [rad] (...)."""
        return heading_quaternion(headings, self.normal)

    def heading(self, attitude: npt.ArrayLike) -> float:
        """The heading [rad] in [0, 2 pi) of an attitude ``x, y, z, w``."""
        return heading_of(attitude, self.normal)

    def checked(self, key: str, values: npt.ArrayLike) -> Array:
        """The unit quaternion of an attitude; an InputError unless it is a turn in the plane."""
        attitude = unit_quaternion(key, values)
        if np.abs(np.cross(attitude[:3], self.normal)).max() > self.tolerance:
            accepted = f"a rotation about {self.axis}"
            if self.is_exact:
                accepted += f": [{', '.join(self.axis if e else '0' for e in self.normal)}, w]"
            raise InputError(key, f"{attitude.tolist()} leaves the {self.name}", accepted)
        return attitude if self.is_exact else frozen(self.levelled(attitude[None])[0])

    def levelled(self, attitudes: Array) -> Array:
        """The attitudes in the plane nearest to attitudes, shape (K, 4)."""
        along = np.outer(attitudes[:, :3] @ self.normal, self.normal)
        level = np.column_stack([along, attitudes[:, 3]])
        return np.asarray(level / np.linalg.norm(level, axis=1, keepdims=True))


LEVEL = Plane.of_normal(np.eye(3)[2])
"""The x-y plane."""


def why_in_no_plane(model: FreeFloatingModel) -> str:
    """Why a robot stays in no plane, see :func:`plane_of`, as the end of a sentence."""
    arms = [VirtualManipulator.of(arm) for arm in model.single_arms]
    if _common_normal(arms) is None:
        axes = np.concatenate([arm.axes_at(np.zeros(len(arm.axes))) for arm in arms])
        axes = axes[~np.concatenate([arm.prismatic for arm in arms])]
        off = np.linalg.norm(np.cross(axes, axes[:1]), axis=1).max(initial=0.0)
        return "its joints have no common direction" + (
            f" (an axis is {off:.2g} rad off; is pi rounded?)" if 0.0 < off < _ROUNDED_PI else ""
        )
    return "its masses are not symmetric about the plane of its arm"


@lru_cache(maxsize=16)
def plane_of(model: FreeFloatingModel) -> Plane | None:
    """The plane parallel to which all bodies move, whatever the joints do.

    None where there is none: the joints have no common direction, or the masses are not symmetric.
    """
    normal = _common_normal([VirtualManipulator.of(arm) for arm in model.single_arms])
    if normal is None:
        return None
    plane = Plane.of_normal(normal)
    if model.on_table and plane.is_level:  # which carries all other moments
        return plane
    for fraction in low_discrepancy(4, model.dof):
        q = model.configuration(UPRIGHT, 2.0 * np.pi * fraction)
        A_G = pin.computeCentroidalMap(model.pin_model, model.scratch, q)[3:]
        moments = np.column_stack([A_G[:, 3:6] @ plane.normal, A_G[:, 6:]])
        if np.abs(plane.rows(moments)[:2]).max() > _SAME_DIRECTION * np.abs(A_G[:, 3:]).max():
            return None
    return plane


def _common_normal(arms: list[VirtualManipulator]) -> Array | None:
    """A direction along all revolute axes and normal to all prismatic ones, shape (3,), or None."""
    axes = np.concatenate([arm.axes_at(np.zeros(len(arm.axes))) for arm in arms])
    prismatic = np.concatenate([arm.prismatic for arm in arms])
    normal = np.eye(3)[2]
    if not prismatic.all():
        normal = axes[~prismatic][0]
    elif (across := np.linalg.norm(np.cross(axes[0], axes), axis=1)).max() > _SAME_DIRECTION:
        normal = np.cross(axes[0], axes[across.argmax()]) / across.max()
    sines = np.linalg.norm(np.cross(axes, normal), axis=1)
    return (
        normal
        if np.where(prismatic, np.abs(axes @ normal), sines).max() < _SAME_DIRECTION
        else None
    )
