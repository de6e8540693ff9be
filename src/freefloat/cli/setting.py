"""What ``freefloat info`` says of a scenario beside its robot: scene, limits, system, goal."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from freefloat.cli.console import decimals

if TYPE_CHECKING:
    from freefloat.io.scenario.scenario import Scenario


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


def setting_lines(scenario: Scenario) -> Iterator[str]:
    """Goal, scene, limits and system in lines, each with its key in the scenario."""
    from freefloat.io.scenario.limits_section import limits_content
    from freefloat.io.scenario.scene_section import scene_content

    system, goal = scenario.system(), scenario.goal()
    contents = {
        "goal": goal.to_dict() if goal else {},
        "scene": scene_content(scenario.scene()),
        "limits": limits_content(scenario.limits(), system.model.joint_names),
    }
    for section, content in contents.items():
        for key, value in content.items():
            for entry in value if _are_records(value) else (value,):
                if entry:
                    yield f"{section}.{key}: {_text(entry)}"
    if system.momentum.any() or system.wheels.any():
        yield f"momentum: {decimals(system.momentum)} N m s, inertial axes"
        yield _rate_at_rest(scenario)
    if system.wheels.any():
        yield f"momentum in wheels: {decimals(system.wheels)} N m s, spacecraft axes"
    if system.drift.any():
        yield f"drift of the centre of mass: {decimals(system.drift)} m/s"


def _are_records(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(entry, dict) for entry in value)


def _text(value: Any) -> str:
    """A value as a scenario has it, in one line."""
    match value:
        case dict():
            return f"{{{', '.join(f'{key}: {_text(part)}' for key, part in value.items())}}}"
        case list():
            return f"[{', '.join(map(_text, value))}]"
        case float():
            return f"{value:.5g}"
        case _:
            return f"{value}"


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
    turn = system.base_rate(attitude, joints, 0.0 * joints)
    rate = math.degrees(float(turn[2]) if system.model.on_table else math.hypot(*turn))
    return f"  {where} the spacecraft turns at {rate:.4g} deg/s while the joints rest"
