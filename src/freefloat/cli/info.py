"""``freefloat info``: description of a robot, and the errors and warnings of its URDF."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated, Any

from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.console import Console, decimals, extent, table
from freefloat.cli.options import Attitude, Json, Quiet, numbers, option
from freefloat.cli.robots import (
    EndEffector,
    FileOptions,
    Packages,
    RobotName,
    Root,
    Xacro,
    diagnostic_lines,
    load_robot,
    not_read_lines,
    warnings_before_errors,
)
from freefloat.errors import one_line

if TYPE_CHECKING:
    from freefloat.dynamics.summary import Configuration, RobotSummary
    from freefloat.io.scenario.scenario import Scenario
    from freefloat.robot.rigid_bodies import Body

_Joints = Annotated[
    Sequence[float] | None,
    option("Q1 Q2 ...", "Show the end-effector pose at these joints, rad or m.", parser=numbers),
]


def info(
    robot: RobotName,
    end_effector: EndEffector = None,
    root: Root = None,
    package: Packages = None,
    xacro: Xacro = None,
    joints: _Joints = None,
    attitude: Attitude = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Describe a robot: bodies, joints, barycentric lengths, errors and warnings of its URDF.

    For a scenario also its scene, its limits of pointing and of the spacecraft's turn, and wheels.

    Errors and warnings have file, line, link or joint, and a correction. With --joints, the pose of
    the end-effector in spacecraft, base and inertial axes, the last from --attitude (identity when
    left out). Exit code 2: the URDF has errors.

    Example: freefloat info ur5_servicer/arc

    Example: freefloat info example-robot-data:ur5 --end-effector tool0

    Example: freefloat info planar_2dof/line --joints 0.5 1.0
    """
    from freefloat.dynamics.summary import RobotSummary
    from freefloat.limits.limits import why_unchecked

    console = Console(as_json, quiet)
    loaded = load_robot(console, robot, end_effector, FileOptions(root, package, xacro))
    scenario = loaded.scenario
    unchecked = why_unchecked(loaded.model)
    summary = RobotSummary(
        loaded.model, loaded.task, loaded.measure, loaded.diagnostics, joints, attitude, unchecked
    )
    setting, limits = ({}, {}) if scenario is None else _setting(scenario)
    with warnings_before_errors(console, loaded.diagnostics):
        console.json(summary.to_dict() | setting | limits)
    default_link = end_effector is None and scenario is None
    console.tables(_tables(summary, default_link))
    if scenario is not None:
        console.tables(_setting_lines(scenario, setting | {"limits": limits}))
    console.tables(_remarks(summary))


def _tables(summary: RobotSummary, default_link: bool) -> Iterator[RenderableType]:
    """The bodies, the joints, and the reach."""
    model, measure, extremes = summary.model, summary.measure, summary.extremes
    yield f"{model.description.source}: {model.total_mass:.6g} kg"
    if arguments := model.description.arguments:
        texts = (f"{a.name} {one_line(a.value)}{' (default)' * a.default}" for a in arguments)
        yield f"xacro arguments: {', '.join(texts)}"
    if model.on_table:
        weight = f"gravity {model.gravity:g} m/s²" if model.gravity else "no gravity"
        yield f"base planar: along x and y, and about z; a table carries the rest; {weight}"
    columns = "moved by", "mass [kg]", "range", "centre of mass [m]", "moments of inertia [kg m²]"
    bodies = table(*columns)
    for number, body in enumerate(model.bodies):
        name, ends = (body.joint, _range(body)) if number else ("spacecraft", "")
        moments = " ".join(f"{x:.4g}" for x in body.inertia.diagonal())
        bodies.add_row(name, f"{body.mass:.6g}", ends, decimals(body.centre), moments)
    yield bodies
    default = " (the last link; --end-effector names another)" if default_link else ""
    yield f"end-effector {model.end_effector}{default}, task {summary.task}, {model.arm_dof} joints"
    if summary.plane is not None:
        yield f"moves in the {summary.plane.name}; headings are about {summary.plane.axis}"
    for name, moves in model.further_motions.items():
        link = model.further_arms[name]
        yield f"arm {name}, to {link}, {moves}; lengths and reach are for zero"
    origin = "the centre of mass"
    if model.on_table and not summary.task.planar:
        origin = "the origin: on the vertical of the centre of mass, at the height of the root link"
    yield (
        f"barycentric lengths {decimals(summary.lengths)} m; the end-effector reaches "
        f"{summary.reach[0]:.5f} to {summary.reach[1]:.5f} m from {origin}"
    )
    yield (
        f"{measure.name}: {measure.definition}; found over the joint space: from "
        f"{extent(extremes.smallest, extremes.largest)} {measure.unit}".removesuffix(" 1")
    )
    if extremes.magnitude == 0.0:
        rates = f"gives the end-effector {len(summary.task.rows)} independent rates"
        problem = f"task {summary.task} is singular everywhere: no configuration {rates}"
        yield Text(problem, "yellow")
    if summary.contact_unchecked is not None:
        yield f"motions are not searched for contact: {summary.contact_unchecked}"
        return
    held = (j for j in model.description.joints if j.moving and j not in model.moving_joints)
    joints = (*model.moving_joints, *held)
    pairs = ", ".join(f"{joint.parent} - {joint.child}" for joint in joints)
    yield f"not compared for contact, because a joint connects them: {pairs}"
    if disabled := model.description.disabled_pairs:
        pairs = one_line(", ".join(sorted(" - ".join(sorted(pair)) for pair in disabled)))
        yield f"not compared for contact, because SRDF disables {len(disabled)} pairs: {pairs}"


def _remarks(summary: RobotSummary) -> Iterator[RenderableType]:
    """The end-effector at given joints, and what validation found."""
    if summary.configuration is not None:
        carrier = summary.model.moving_joints[0].parent
        yield from _configuration_lines(summary.configuration, carrier)
    yield from diagnostic_lines(summary.diagnostics)
    yield from not_read_lines(summary.model.not_read)


def _configuration_lines(configuration: Configuration, carrier: str) -> Iterator[RenderableType]:
    """The pose of the end-effector in each frame, and the measures."""
    from freefloat.dynamics.summary import roll_pitch_yaw

    yield f"end-effector at joints {decimals(configuration.joints)}"
    poses = table("frame", "position [m]", "quaternion x y z w", "roll pitch yaw [rad]")
    for frame, pose in configuration.poses.items():
        poses.add_row(frame, decimals(pose.position, 5), decimals(pose.quaternion, 6),
                      decimals(roll_pitch_yaw(pose.rotation), 5))  # fmt: skip
    yield poses
    yield f"base: link {carrier}, which carries the arm; inertial: about the centre of mass"
    yield ", ".join(f"{name} {value:.6g}" for name, value in configuration.measures.items())


def _range(body: Body) -> str:
    if body.prismatic:
        lower, upper = f"{body.lower:g}", f"{body.upper:g} m"
    else:
        lower, upper = f"{math.degrees(body.lower):.4g}°", f"{math.degrees(body.upper):.4g}°"
    if math.isinf(body.lower):
        return "unlimited" if math.isinf(body.upper) else f"at most {upper}"
    return f"at least {lower}" if math.isinf(body.upper) else f"{lower} to {upper}"


def _setting(scenario: Scenario) -> tuple[dict[str, Any], dict[str, Any]]:
    """Goal, scene, wheels and drift of a scenario with its keys; and its limits."""
    from freefloat.io.scenario.limits_section import limits_content
    from freefloat.io.scenario.scene_section import scene_content

    system, goal = scenario.system(), scenario.goal()
    setting = {
        "goal": goal and goal.to_dict(),
        "scene": scene_content(scenario.scene()),
        "wheel_momentum": system.wheels.tolist(),
        "drift": system.drift.tolist(),
    }
    return setting, limits_content(scenario.limits(), system.model.joint_names)


def _setting_lines(scenario: Scenario, setting: dict[str, Any]) -> Iterator[str]:
    """Goal, scene, limits and system in lines, each with its key in the scenario."""
    for section in ("goal", "scene", "limits"):
        for key, value in (setting[section] or {}).items():
            several = isinstance(value, list) and all(isinstance(part, dict) for part in value)
            for entry in value if several else (value,):
                if entry:
                    yield f"{section}.{key}: {_text(entry)}"
    system = scenario.system()
    if system.momentum.any() or system.wheels.any():
        yield f"momentum: {decimals(system.momentum)} N m s, inertial axes"
        yield _rate_at_rest(scenario)
    if system.wheels.any():
        yield f"momentum in wheels: {decimals(system.wheels)} N m s, spacecraft axes"
    if system.drift.any():
        yield f"drift of the centre of mass: {decimals(system.drift)} m/s"


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
