"""Limits of a motion in addition to its joint ranges."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, Literal, cast

import numpy as np

from freefloat.errors import require_type
from freefloat.limits.kinds import KINDS
from freefloat.limits.limit import MagnitudeLimit
from freefloat.motion.pointing import AttitudeLimits
from freefloat.motion.setting import Setting
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array


@dataclass(frozen=True, eq=False)
class Limits(AttitudeLimits):
    """Limits in addition to the joint ranges of the URDF; None for limits that do not apply.

    Without limits of pointing ``pointing`` is empty. Contact is a limit also where no clearance is
    given: links with ``<collision>`` shapes that no joint connects, and bodies of the problem's
    scene, do not touch. What cannot be compared is named in ``notes`` of the result.

    Attributes:
        joint_rate: Magnitudes [rad/s or m/s], shape (n,), infinite for joints without a limit; or
            one number for all joints.
        joint_torque: Magnitudes [N m or N], likewise.
        joint_acceleration: Magnitudes [rad/s² or m/s²], likewise.
        joint_jerk: Magnitudes of the accelerations' derivatives [rad/s³ or m/s³], likewise.
        base_rate: Magnitude of the spacecraft's angular velocity [rad/s].
        clearance: Smallest distance [m] between bodies that no joint connects, and between the
            robot and bodies of the problem's scene. 0: no contact, also of visuals of links without
            collision shapes; a robot without shapes that can be used is refused. ``"off"`` or
            ``False``: bodies may touch. None: no contact where there are collision shapes.
        pointing: Axes of links that stay inside or outside cones.
        base_turn: Largest angle between the attitudes of the spacecraft at the start and at any
            time [rad], up to pi.

    Raises:
        InputError: If a limit is not positive, the clearance is negative and not ``"off"``, or the
            turn is above pi.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> limits = ff.Limits(joint_rate=0.2, base_rate=0.01)
        >>> simulation = ff.simulate(problem, [0.0, 0.0, 0.0, 1.0], limits=limits)
        >>> for result in simulation.limit_results:
        ...     print(result.limit, result.kept)
        joint_rate True
        base_rate False
        clearance True
    """

    joint_rate: Array | None = None
    joint_torque: Array | None = None
    base_rate: float | None = None
    clearance: float | Literal["off"] | None = None
    joint_acceleration: Array | None = None
    joint_jerk: Array | None = None

    def __post_init__(self) -> None:
        for kind in GIVEN:
            bound = getattr(self, kind.name)
            if bound is not None or kind.name == "pointing":
                checked = kind.value.checked(f"limits.{kind.name}", bound)
                object.__setattr__(self, kind.name, checked)

    @property
    def without_timed(self) -> Limits:
        """The limits that do not depend on the speed along the path."""
        timed: dict[str, Any] = {kind.name: None for kind in GIVEN if kind.exponent}
        return replace(self, **timed)

    @property
    def without_turn(self) -> Limits:
        """The limits of motions that are meant to turn the spacecraft: all but ``base_turn``."""
        return replace(self, base_turn=None)

    def narrower(self, fraction: float) -> Limits:
        """The limits with angles of pointing and turn that leave less room, by a fraction."""
        if not self.number:
            return self
        pointing = tuple(limit.narrower(fraction) for limit in self.pointing)
        turn = None if self.base_turn is None else (1.0 - fraction) * self.base_turn
        return replace(self, pointing=pointing, base_turn=turn)

    def of_joints(self, count: int) -> Limits:
        """The limits of a robot of whose joints only the first ones move, as arrays (count,)."""
        bounds: dict[str, Any] = {
            kind.name: bound[:count] if bound.ndim else np.full(count, bound)
            for kind in GIVEN
            if issubclass(kind, MagnitudeLimit)
            and (bound := getattr(self, kind.name)) is not None
            and bound.shape != (count,)
        }
        return replace(self, **bounds) if bounds else self

    @property
    def timed(self) -> bool:
        """Whether any limit depends on the speed along the path."""
        return self._has_exponents(1)

    @property
    def accelerated(self) -> bool:
        """Whether any limit depends on accelerations along the path."""
        return self._has_exponents(2)

    def _has_exponents(self, least: int) -> bool:
        kinds = (kind for kind in GIVEN if getattr(self, kind.name) is not None)
        return any(kind.exponent >= least for kind in kinds)


_FIELDS = [field.name for field in sorted(fields(Limits), key=lambda field: bool(field.kw_only))]
GIVEN = tuple(kind for name in _FIELDS for kind in KINDS if kind.name == name)
"""The limits that are attributes of :class:`Limits`, limits of attitude last."""


def require_applicable(model: FreeFloatingModel, limits: AttitudeLimits) -> None:
    """Raise an InputError unless limits belong to a robot's joints and links."""
    accepted = "Limits, such as Limits(base_rate=0.02), or load_scenario(...).limits()"
    require_type("limits", limits, Limits, accepted)
    for kind in GIVEN:
        if (bound := getattr(limits, kind.name)) is not None:
            kind.value.require_applicable(f"limits.{kind.name}", bound, model)


def limits_for(setting: Setting, given: Limits | None) -> Limits | None:
    """The limits of motions in a setting: the given limits, else the limits that it carries.

    Raises:
        InputError: If they do not belong to the robot's joints and links.
    """
    limits = setting.limits if given is None else given
    if limits is None:
        return None
    require_applicable(setting.model, limits)
    return cast(Limits, limits).of_joints(setting.model.dof)
