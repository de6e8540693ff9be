"""A rigid body of the drifting chain."""

from __future__ import annotations

from dataclasses import dataclass

from freefloat.so3 import Array, Pose


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body of the drifting chain: fixed joints merged, held joints frozen.

    Attributes:
        joint: Name of the joint that moves it; ``"root_joint"`` for the spacecraft.
        placement: Of the joint's frame in the previous body's, the joint at zero.
        axis: Unit vector of the joint in its own frame, shape (3,); zeros for the spacecraft.
        prismatic: Whether the joint slides along the axis instead of turning about it.
        lower: Joint range from the URDF [rad or m]; minus infinity for continuous joints.
        upper: Likewise.
        rated_speed: From the URDF [rad/s or m/s]; infinite where it tells none.
        rated_effort: From the URDF [N m or N]; infinite where it tells none.
        mass: [kg].
        centre: Centre of mass in the joint's frame [m], shape (3,).
        inertia: About the centre of mass, axes of the joint's frame [kg m²], shape (3, 3).
    """

    joint: str
    placement: Pose
    axis: Array
    prismatic: bool
    lower: float
    upper: float
    rated_speed: float
    rated_effort: float
    mass: float
    centre: Array
    inertia: Array
