"""What ``freefloat info`` says of a scenario beside its robot: scene, limits, system, goal."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType

from freefloat.cli.console import decimals, table

if TYPE_CHECKING:
    from freefloat.io.scenario.scenario import Scenario
    from freefloat.motion.pointing import PointingLimit
    from freefloat.scene.scene import Corridor
    from freefloat.scene.scene_body import SceneBody


def setting_document(scenario: Scenario) -> dict[str, Any]:
    """Scene, limits, wheels, drift and goal with the keys of a scenario."""
    from freefloat.io.scenario.limits_section import limits_content
    from freefloat.io.scenario.scene_section import scene_content

    system, goal = scenario.system(), scenario.goal()
    limits = limits_content(scenario.limits(), system.model.joint_names)
    return {
        "scene": scene_content(scenario.scene()),
        **limits,
        "wheel_momentum": system.wheels.tolist(),
        "drift": system.drift.tolist(),
        "goal": goal and goal.to_dict(),
    }


def setting_tables(scenario: Scenario) -> Iterator[RenderableType]:
    """The same as tables and lines, of those that there are."""
    from freefloat.io.scenario.limits_section import limits_content

    system, scene, limits = scenario.system(), scenario.scene(), scenario.limits()
    goal = scenario.goal()
    for key, value in goal.to_dict().items() if goal else ():
        yield f"goal.{key}: {_goal_value(value)}"
    if scene.bodies:
        rows = table("body of the scene", "shape", "position [m]", "motion")
        for body in scene.bodies:
            rows.add_row(body.name, _shape(body), decimals(body.position), _motion(body))
        yield rows
    if scene.corridor is not None:
        yield _corridor(scene.corridor)
    if limits.pointing:
        rows = table("limit of pointing", "axis", "keeps", "target")
        for number, limit in enumerate(limits.pointing):
            angle = f"{limit.keep} {math.degrees(limit.angle):.4g}°"
            rows.add_row(limit.title(number), decimals(limit.axis), angle, _target(limit))
        yield rows
    for key, bound in limits_content(limits, system.model.joint_names).items():
        if bound is not None and key != "pointing":
            yield f"limits.{key}: {_bound(bound)}"
    if system.momentum.any() or system.wheels.any():
        yield f"momentum: {decimals(system.momentum)} N m s, inertial axes"
        yield _rate_at_rest(scenario)
    if system.wheels.any():
        yield f"momentum in wheels: {decimals(system.wheels)} N m s, spacecraft axes"
    if system.drift.any():
        yield f"drift of the centre of mass: {decimals(system.drift)} m/s"


def _rate_at_rest(scenario: Scenario) -> str:
    """How fast the spacecraft turns while the joints rest, in the present state or the zero one."""
    import numpy as np

    system, search = scenario.system(), scenario.search()
    if search.from_attitude is None or search.joints is None:
        where = "at the identity, joints at zero"
        attitude, joints = np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(system.model.dof)
    else:
        where = "in the present state"
        with scenario.error_context():
            attitude, joints = search.present_state(system.model)
    rate = math.degrees(math.hypot(*system.base_rate(attitude, joints, 0.0 * joints)))
    return f"  {where} the spacecraft turns at {rate:.4g} deg/s while the joints rest"


def _goal_value(value: Any) -> str:
    """A number, numbers, a frame, or these by name."""
    match value:
        case dict():
            return ", ".join(f"{key} {_goal_value(part)}" for key, part in value.items())
        case list():
            return decimals(value)
        case _:
            return f"{value}"


def _bound(bound: float | str | dict[str, float]) -> str:
    """A bound, those of joints, or off."""
    if isinstance(bound, dict):
        return ", ".join(f"{joint} {value:g}" for joint, value in bound.items())
    return bound if isinstance(bound, str) else f"{bound:.4g}"


def _shape(body: SceneBody) -> str:
    """Kind and size of a body."""
    from pathlib import Path

    from freefloat.robot.shapes import Box, Cylinder, MeshFile, Sphere

    match body.shape:
        case Box(size=size):
            return f"box {' x '.join(f'{edge:g}' for edge in size)} m"
        case Sphere(radius=radius):
            return f"sphere, radius {radius:g} m"
        case Cylinder(radius=radius, length=length):
            return f"cylinder, radius {radius:g} m, length {length:g} m"
        case MeshFile(filename=name):
            return f"mesh {Path(name).name}"
        case description:
            return f"URDF {Path(description.source).name}"


def _motion(body: SceneBody) -> str:
    from freefloat.scene.tumbling import Tumbling

    if isinstance(body.motion, Tumbling):
        rate = math.degrees(math.hypot(*body.motion.rate))
        return f"tumbling, {rate:.4g} deg/s"
    return "fixed" if body.motion == "fixed" else "with the target"


def _corridor(corridor: Corridor) -> str:
    if corridor.half_angle is None:
        kind = f"cylinder of radius {corridor.radius:g} m through"
    else:
        kind = f"cone of half angle {math.degrees(corridor.half_angle):.4g} deg from"
    frame = "" if corridor.body is None else f", axes of {corridor.body}"
    return f"corridor: {kind} {decimals(corridor.point)} m along {decimals(corridor.axis)}{frame}"


def _target(limit: PointingLimit) -> str:
    if limit.direction is not None:
        return f"direction {decimals(limit.direction)}"
    return f"point {decimals(() if limit.point is None else limit.point)} m"
