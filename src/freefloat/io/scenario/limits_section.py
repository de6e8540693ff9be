"""The ``limits`` section of scenario files: its keys, its limits, and limits as such a section.

The keys are the limits' own. How a file states a bound depends on what the bound is.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, WithJsonSchema, create_model

from freefloat.errors import InputError, did_you_mean
from freefloat.io.scenario.field_types import Name, Positive, Section, Vector, exactly_one_of
from freefloat.io.scenario.yaml import file_keys
from freefloat.limits.limit import Axes, Limit, Number, NumberOrOff, PerJoint, Value
from freefloat.limits.limits import GIVEN, Limits
from freefloat.motion.pointing import Keep, PointingLimit
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, degrees


class TargetSection(Section):
    """What an axis is compared with; exactly one key."""

    direction: Vector | None = None
    """Direction of a target far away, inertial axes."""
    point: Vector | None = None
    """A point [m], inertial axes, about the centre of mass at time zero."""

    _exactly_one = exactly_one_of("direction", "point")


class PointingSection(Section):
    """An axis that stays inside or outside a cone about the direction of a target."""

    name: Name | None = None
    """What results, figures and pages call it; by default its link and its number."""
    body: Name
    """A link, which may be the root link of the spacecraft."""
    axis: Vector
    """Axis in the frame of the link; toward a point, it begins at the origin of that frame."""
    target: TargetSection
    """What it is compared with."""
    keep: Keep = Keep.INSIDE
    """``inside``: the target is seen; ``outside``: it is avoided."""
    angle_deg: Annotated[float, Field(strict=True, gt=0.0, lt=180.0)]
    """Half the opening angle of the cone [degrees]."""


_Off = Annotated[
    Literal["off"],
    BeforeValidator(lambda value: "off" if value is False else value),  # as YAML 1.1 reads off
    WithJsonSchema({"enum": ["off", False]}),
]


def _key(kind: type[Limit[Any]]) -> str:
    """The key of a limit: its name, and its unit where that is degrees."""
    angle = isinstance(kind.value, Number) and kind.value.angle
    return f"{kind.name}_deg" if angle else kind.name


def _field(kind: type[Limit[Any]]) -> Any:
    """The type of a limit's content, and its default with its description."""
    match kind.value:
        case Axes():
            return list[PointingSection], Field(default=[], description=kind.description)
        case PerJoint():
            content: Any = Positive | dict[str, Positive] | Literal["urdf"]
        case Number(zero=zero, most=most, angle=angle):
            above, least = (None, 0.0) if zero else (0.0, None)
            most = float(np.degrees(most)) if angle else most
            content = Annotated[float, Field(strict=True, gt=above, ge=least, le=most)]
            if isinstance(kind.value, NumberOrOff):
                content |= _Off
    return content | None, Field(default=None, description=kind.description)


_KINDS = {_key(kind): kind for kind in GIVEN}
LimitsSection = create_model(
    "LimitsSection",
    __base__=Section,
    __doc__="Limits of a motion, besides the joint ranges of the URDF.",
    **{key: _field(kind) for key, kind in _KINDS.items()},
)


def limits_of(section: Section, model: FreeFloatingModel) -> Limits:
    """Limits that a section describes.

    Raises:
        InputError: If a joint or a link is unknown, or the URDF lacks a limit that is taken from
            it.
    """
    contents = ((key, kind, getattr(section, key)) for key, kind in _KINDS.items())
    return Limits(**{
        kind.name: _bound(kind.value, key, content, model)
        for key, kind, content in contents if content is not None
    })  # fmt: skip


def limits_content(limits: Limits, joints: tuple[str, ...]) -> dict[str, Any]:
    """Content of the section that describes limits; None for those that do not apply."""
    bounds = ((key, kind.value, getattr(limits, kind.name)) for key, kind in _KINDS.items())
    return {
        key: None if bound is None else _content(value, bound, joints)
        for key, value, bound in bounds
    }


def _bound(value: Value, key: str, content: Any, model: FreeFloatingModel) -> Any:
    """The bound that the content of a key states."""
    match value:
        case Axes():
            entries = enumerate(content)
            return tuple(_pointing_limit(f"{key}.{k}", entry, model) for k, entry in entries)
        case PerJoint(rated=rated):
            return _magnitudes(key, content, rated, model)
        case Number(angle=True):
            return float(np.radians(content))
    return content


def _content(value: Value, bound: Any, joints: tuple[str, ...]) -> Any:
    """The content that states a bound; of joints those with a limit."""
    match value:
        case Axes():
            return [axis.to_dict() for axis in bound]
        case PerJoint():
            pairs = zip(joints, bound.tolist(), strict=True)
            return {joint: magnitude for joint, magnitude in pairs if np.isfinite(magnitude)}
        case Number(angle=True):
            return degrees(bound)
    return bound


def _pointing_limit(key: str, section: PointingSection, model: FreeFloatingModel) -> PointingLimit:
    names = ("axis", "angle", "target", "body")
    with file_keys(**{name: f"{key}.{name}" for name in names}):
        arguments = section.attributes()
        limit = PointingLimit(**arguments.pop("target"), **arguments)
        limit.require_body(model, "body")
    return limit


def _magnitudes(key: str, content: Any, rated: str, model: FreeFloatingModel) -> Array:
    """Magnitudes by joint, infinite for joints that a map leaves out."""
    joints = {str(body.joint): body for body in model.bodies[1:]}
    if content == "urdf":
        values = {joint: getattr(body, rated) for joint, body in joints.items()}
        unknown = [joint for joint, value in values.items() if not np.isfinite(value)]
        if unknown:
            problem = f"the URDF has none for {', '.join(unknown)}"
            raise InputError(key, problem, "a number, or a map from joint to number")
        return np.array(list(values.values()))
    if isinstance(content, dict):
        for joint in content:
            if joint not in joints:
                problem = f"there is no such moving joint{did_you_mean(joint, joints)}"
                raise InputError(f"{key}.{joint}", problem, ", ".join(joints))
        return np.array([content.get(joint, np.inf) for joint in joints])
    return np.full(len(joints), content)
