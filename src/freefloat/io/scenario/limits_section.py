"""The ``limits`` section of a scenario as limits, and limits as such a section."""

from __future__ import annotations

from typing import Any

import numpy as np

from freefloat.errors import InputError, did_you_mean
from freefloat.io.scenario.schema import JointLimits, LimitsSection, PointingSection
from freefloat.io.scenario.yaml import file_keys
from freefloat.limits.limits import Limits
from freefloat.motion.pointing import PointingLimit
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, degrees

_JOINT_LIMITS = ("joint_rate", "joint_torque")


def limits_of(section: LimitsSection, model: FreeFloatingModel) -> Limits:
    """Limits that a section describes.

    Raises:
        InputError: If a joint or a link is unknown, or the URDF lacks a limit that is taken from
            it.
    """
    bodies = model.bodies[1:]
    speeds = {str(body.joint): body.rated_speed for body in bodies}
    efforts = {str(body.joint): body.rated_effort for body in bodies}
    return Limits(
        _joint_limits("joint_rate", section.joint_rate, speeds),
        _joint_limits("joint_torque", section.joint_torque, efforts),
        section.base_rate,
        section.clearance,
        tuple(
            _pointing_limit(f"pointing.{k}", entry, model)
            for k, entry in enumerate(section.pointing)
        ),
        section.base_turn_deg and float(np.radians(section.base_turn_deg)),
    )


def _pointing_limit(key: str, section: PointingSection, model: FreeFloatingModel) -> PointingLimit:
    names = ("axis", "angle", "target", "body")
    with file_keys(**{name: f"{key}.{name}" for name in names}):
        axis, angle = np.array(section.axis), float(np.radians(section.angle_deg))
        target = section.target.model_dump()
        limit = PointingLimit(section.body, axis, angle, section.keep, **target)
        limit.require_body(model, "body")
    return limit


def _joint_limits(key: str, values: JointLimits | None, rated: dict[str, float]) -> Array | None:
    """Limits by joint, infinite for joints that a map leaves out; None without limits."""
    if values is None:
        return None
    if values == "urdf":
        unknown = [joint for joint, value in rated.items() if not np.isfinite(value)]
        if unknown:
            problem = f"the URDF has none for {', '.join(unknown)}"
            raise InputError(key, problem, "a number, or a map from joint to number")
        return np.array(list(rated.values()))
    if isinstance(values, dict):
        for joint in values:
            if joint not in rated:
                problem = f"there is no such moving joint{did_you_mean(joint, rated)}"
                raise InputError(f"{key}.{joint}", problem, ", ".join(rated))
        return np.array([values.get(joint, np.inf) for joint in rated])
    return np.full(len(rated), values)


def limits_content(limits: Limits, joints: tuple[str, ...]) -> dict[str, Any]:
    """Content of the section that describes limits; None for those that do not apply."""
    return {
        **{key: _limit_map(joints, getattr(limits, key)) for key in _JOINT_LIMITS},
        "base_rate": limits.base_rate and float(limits.base_rate),
        "clearance": limits.clearance and float(limits.clearance),
        "pointing": [limit.to_dict() for limit in limits.pointing],
        "base_turn_deg": degrees(limits.base_turn),
    }


def _limit_map(joints: tuple[str, ...], values: Array | None) -> dict[str, float] | None:
    """Finite limits by joint."""
    if values is None:
        return None
    pairs = zip(joints, values.tolist(), strict=True)
    return {joint: value for joint, value in pairs if np.isfinite(value)}
