"""Limits of a motion in addition to its joint ranges; limits and contact along motions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, cast

import numpy as np

from freefloat.errors import require_type
from freefloat.limits.kinds import KINDS
from freefloat.limits.kinds.clearance import ClearanceLimit, have_shapes
from freefloat.limits.limit import Limit, MagnitudeLimit
from freefloat.limits.result import LimitResult, violated
from freefloat.motion.motion import Motion
from freefloat.motion.pointing import AttitudeLimits
from freefloat.motion.setting import Setting
from freefloat.robot.model import FreeFloatingModel
from freefloat.scene.scene import Scene
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


def check_limits(motion: Motion, limits: Limits | None = None) -> tuple[LimitResult, ...]:
    """The results of all limits along a motion, the scene's corridor and joint ranges first.

    Args:
        motion: Motion along a path or with prescribed joints; joints are compared with their ranges
            as they are; see :func:`freefloat.motion.extrema.unwrapped`.
        limits: The limits in addition to the joint ranges; the setting's limits when left out.

    Raises:
        InputError: If there are not as many limits as joints.
        ModelError: If a clearance is required and the robot's shapes cannot be used.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> motion = ff.simulate(problem, [0.0, 0.0, 0.0, 1.0]).chosen.motion
        >>> for result in ff.check_limits(motion, ff.Limits(joint_rate=np.array([0.2, 0.01]))):
        ...     print(result.limit, result.kept)
        joint_rate False
        clearance True
    """
    require_type("motion", motion, Motion, "a Motion, such as simulate(...).chosen.motion")
    limits = limits_for(motion.setting, limits) or Limits()
    return LimitChecker(motion.setting, limits).results(motion)


def attitude_limits(setting: Setting, limits: AttitudeLimits) -> tuple[Limit[Any], ...]:
    """Limits of attitude, prepared for the motions in a setting."""
    return _prepared([kind for kind in KINDS if kind.of_attitude], setting, limits)


def _prepared(
    kinds: Iterable[type[Limit[Any]]], setting: Setting, limits: AttitudeLimits
) -> tuple[Limit[Any], ...]:
    prepared = (kind.of(setting, limits) for kind in kinds)
    return tuple(limit for limit in prepared if limit is not None)


class LimitChecker:
    """The limits of a robot and its scene, prepared for many motions, whatever moves the arm.

    Attributes:
        limits: Limits that apply, in the order in which they are checked.
        pairs: The pairs of shapes that keep a clearance; None where there are none.
    """

    def __init__(self, setting: Setting, limits: Limits) -> None:
        """Prepare limits in addition to joint ranges and corridor; see :func:`check_limits`."""
        require_applicable(setting.model, limits)
        self.limits = _prepared(KINDS, setting, limits)
        pairs = (limit.pairs for limit in self.limits if isinstance(limit, ClearanceLimit))
        self.pairs = next((some for some in pairs if len(some.pairs)), None)

    def results(self, motion: Motion) -> tuple[LimitResult, ...]:
        """The results of all limits."""
        return tuple(limit.worst(motion) for limit in self.limits)

    def timed(self, motion: Motion) -> tuple[LimitResult, ...]:
        """The results of limits that depend on the speed."""
        return tuple(limit.worst(motion) for limit in self.limits if limit.exponent)

    def results_unless_violated(
        self, motion: Motion
    ) -> tuple[tuple[LimitResult, ...], LimitResult | None]:
        """The results of all limits, or none and the first violated one, the cheapest first.

        The distance of a violated clearance is too small, but need not be the smallest one.
        """
        decided = []
        for limit in self.limits:
            result = limit.decide(motion)
            if not result.kept:
                return (), result
            decided.append(result)
        return tuple(
            limit.worst(motion) if limit.decides_sooner else result
            for limit, result in zip(self.limits, decided, strict=True)
        ), None

    def violations(self, motion: Motion, *, timed: bool = True) -> tuple[LimitResult, ...]:
        """The results of all violated limits, clearances as :meth:`results_unless_violated` has.

        Limits that depend on the speed may be left out.
        """
        checked = (limit for limit in self.limits if timed or not limit.exponent)
        return violated(limit.decide(motion) for limit in checked)


@dataclass(frozen=True)
class Contact:
    """The deepest contact of two bodies along a motion.

    Attributes:
        bodies: Links that overlap, the one nearer to the spacecraft first, or a link and a body of
            the scene.
        depth: Penetration depth [m].
        time: Time of the contact [s].
        s: Path parameter at that time.
    """

    bodies: tuple[str, str]
    depth: float
    time: float
    s: float

    def __str__(self) -> str:
        first, second = self.bodies
        return f"{second} overlaps {first} by {self.depth:.3g} m at t = {self.time:.4f} s"

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return {"bodies": [*self.bodies], "depth": self.depth, "time": self.time, "s": self.s}


def deepest_contact(motion: Motion, results: Iterable[LimitResult] = ()) -> Contact | None:
    """The deepest contact along a motion, of the pairs whose contact is a limit by default.

    None without contact of more than 0.1 mm, and where a limit of the clearance shows it.

    Args:
        motion: The motion.
        results: Limits along it.
    """
    if any(entry.limit == ClearanceLimit.name for entry in results):
        return None
    limit = ClearanceLimit.of_contact(motion.setting)
    if limit is None or not len(limit.pairs.pairs):
        return None
    from freefloat.limits.clearance import TOLERANCE, clearance  # coal and trimesh import slowly

    nearest = clearance(motion, limit.pairs, -TOLERANCE)
    if nearest.distance > -TOLERANCE:
        return None
    s = motion.law.timing.s(nearest.time)
    return Contact(limit.pairs.links(nearest.pair), -nearest.distance, nearest.time, s)


def why_unchecked(model: FreeFloatingModel) -> str | None:
    """Reason why no motion of a robot is in contact with itself; None where one may be."""
    if not have_shapes(model, Scene()):
        return "fewer than two links have <collision> shapes; limits.clearance takes visuals, too"
    from freefloat.limits.pairs import CollisionPairs  # coal and trimesh import slowly

    pairs = CollisionPairs(model, stated=False)
    if len(pairs.pairs):
        return None
    return "; ".join(pairs.left_out) or (
        "joints connect all links with <collision> shapes, or <disable_collisions> has them"
    )
