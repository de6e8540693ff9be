"""Limits and contact along a motion, each at the instant of its largest ratio."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from freefloat.errors import require_type
from freefloat.limits.kinds import KINDS
from freefloat.limits.kinds.clearance import ClearanceLimit, have_shapes
from freefloat.limits.limit import Limit
from freefloat.limits.limits import Limits, limits_for, require_applicable
from freefloat.limits.result import LimitResult, violated
from freefloat.motion.motion import Motion
from freefloat.motion.pointing import AttitudeLimits
from freefloat.motion.setting import Setting
from freefloat.robot.model import FreeFloatingModel
from freefloat.scene.scene import Scene


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
        """Prepare the limits; raises as :func:`check_limits`.

        Args:
            setting: Setting of the motions, such as their problem.
            limits: The limits in addition to the joint ranges and the scene's corridor.
        """
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
