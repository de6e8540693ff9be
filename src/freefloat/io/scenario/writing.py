"""Scenarios that pose given problems, for files of results."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from freefloat.dynamics.redundancy import Toward
from freefloat.io.scenario.arms_section import arms_content
from freefloat.io.scenario.limits_section import limits_content
from freefloat.io.scenario.path_schema import inexpressible, timing_content
from freefloat.io.scenario.path_section import section_of, sections_of_arms
from freefloat.io.scenario.scenario import Scenario, parse_scenario
from freefloat.io.scenario.scene_section import file_shapes, scene_content
from freefloat.kinds import SECTIONS, named
from freefloat.limits.limits import Limits, limits_for
from freefloat.motion.problem import Problem
from freefloat.planning.objectives import NAMED, Weights
from freefloat.planning.settings import Search
from freefloat.robot.source import URDF_TEXT


def scenario_of(
    problem: Problem,
    search: Search | None = None,
    limits: Limits | None = None,
    phases: Sequence[Any] = (),
    *,
    reorient: bool = False,
) -> Scenario:
    """Scenario that poses a problem: the inverse of :meth:`Scenario.problem`.

    Its robot is that of the problem. The text names the URDF that this came from, or, where there
    is none or parts or masses are not those of the URDF, the file ``robot.urdf``, into which
    ``problem.model.description.text`` is to be written; files of points are in ``samples``.

    Args:
        problem: The problem of the path.
        search: The search for a plan.
        limits: Limits to keep; those of the problem when left out.
        phases: What follows the path.
        reorient: Whether a reorientation leads to the start of the path.

    Raises:
        InputError: If scenario files cannot describe the path of the problem, the objective or a
            phase.
    """
    model = problem.model
    unnamed = model.description.altered or model.description.source == URDF_TEXT
    stated, timing = problem.path.stated
    margin = problem.margin
    search = search or Search(joints=problem.start_joints)
    limits = limits_for(problem, limits) or Limits()
    if type(search.objective) not in (Weights, *map(type, NAMED.values())):
        raise inexpressible("search.objective", search.objective, f"{', '.join(NAMED)}, Weights")
    shapes = file_shapes(problem.scene)
    path, samples = section_of(stated)
    if problem.path.frame is not None:
        path["frame"] = problem.path.frame
    sections: dict[str, dict[str, Any]] = {
        "robot": {
            "urdf": "robot.urdf" if unnamed else model.description.source,
            "end_effector": model.end_effector,
            "base": str(model.base) if model.on_table else None,
            "gravity": model.gravity or None,
            "held": {name: float(value) for name, value in model.fixed_joints.items()},
            "arms": arms_content(model, problem.arms, sections_of_arms(problem.path)) or None,
        },
        "path": path,
        "timing": timing_content(timing),
        "margin": {"measure": margin.measure.name, "value": float(margin.threshold)},
        "search": search.to_dict() | ({"reorient": True} if reorient else {}),
        "limits": limits_content(limits, model.joint_names),
        "scene": scene_content(problem.scene),
    }
    if problem.redundancy is not None:
        sections["redundancy"] = problem.redundancy.to_dict()
        if problem.redundancy.toward is Toward.NONE:
            sections["redundancy"] |= {"gain": None, "bound": None}
    content = {"task": str(problem.task), "momentum": problem.momentum.tolist()}
    if problem.wheel_momentum.any():
        sections["wheels"] = {"momentum": problem.wheel_momentum.tolist()}
    if problem.path.drifts:
        content["drift"] = problem.path.drift.tolist()
    for name, section in sections.items():
        content[name] = {key: value for key, value in section.items() if value is not None}
    if phases:
        content["phases"], further = named(SECTIONS["phases"].content)(phases)
        samples |= further
    text = yaml.safe_dump(content, sort_keys=False)
    return parse_scenario(text, Path("scenario.yaml"), samples, model, shapes)
