"""Scenarios that pose given problems, for files of results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from freefloat.dynamics.redundancy import Toward
from freefloat.io.files import path_text
from freefloat.io.scenario.arms_section import arms_content
from freefloat.io.scenario.limits_section import limits_content
from freefloat.io.scenario.loading import parse_scenario
from freefloat.io.scenario.path_schema import inexpressible, timing_content
from freefloat.io.scenario.path_section import section_of, sections_of_arms
from freefloat.io.scenario.scenario import Scenario
from freefloat.io.scenario.scene_section import file_shapes, scene_content
from freefloat.limits.limits import Limits, limits_for
from freefloat.motion.problem import Problem
from freefloat.motion.setting import Setting
from freefloat.planning.objectives import NAMED, Weights
from freefloat.planning.settings import Search
from freefloat.robot.source import URDF_TEXT


def scenario_of_result(result: Any) -> Scenario:
    """The scenario that poses a result of a problem, see :func:`scenario_of`."""
    search, limits = getattr(result, "search", None), getattr(result, "limits", None)
    return scenario_of(result.problem, search, limits)


def scenario_of(
    problem: Problem,
    search: Search | None = None,
    limits: Limits | None = None,
    sections: Mapping[str, Any] | None = None,
    samples: Mapping[str, str] | None = None,
) -> Scenario:
    """Scenario that poses a problem: the inverse of :meth:`Scenario.problem`.

    Its robot is the problem's, see :func:`written_scenario`; files of points are in ``samples``.

    Args:
        problem: The problem of the path.
        search: The search for a plan.
        limits: Limits to keep; the problem's limits when left out.
        sections: Further sections, or others in place of the problem's.
        samples: Files of points that the sections name.

    Raises:
        InputError: If scenario files cannot describe the path of the problem or the objective.
    """
    (stated, timing), margin = problem.path.stated, problem.margin
    search = search or Search(joints=problem.start_joints)
    if type(search.objective) not in (Weights, *map(type, NAMED.values())):
        raise inexpressible("search.objective", search.objective, f"{', '.join(NAMED)}, Weights")
    path, points = section_of(stated)
    if problem.path.frame is not None:
        path["frame"] = problem.path.frame
    content: dict[str, Any] = {
        "task": str(problem.task),
        "path": path,
        "timing": timing_content(timing),
        "margin": {"measure": margin.measure.name, "value": float(margin.threshold)},
        "search": search.to_dict(),
    }
    if problem.redundancy is not None:
        content["redundancy"] = problem.redundancy.to_dict()
        if problem.redundancy.toward is Toward.NONE:
            content["redundancy"] |= {"gain": None, "bound": None}
    arms = arms_content(problem, sections_of_arms(problem.path))
    content |= sections or {}
    written = written_scenario(problem, limits, content, arms, {**points, **(samples or {})})
    return replace(written, start_joints=problem.start_joints)


def written_scenario(
    setting: Setting,
    limits: Limits | None,
    content: Mapping[str, Any],
    arms: Mapping[str, Any] | None = None,
    samples: Mapping[str, str] | None = None,
) -> Scenario:
    """Scenario with a setting, and with what is asked for.

    The text names the URDF that the robot came from, or, where there is none or parts or masses are
    not the URDF's, the file ``robot.urdf``, into which ``model.description.text`` is to be
    written.

    Args:
        setting: Robot, momentum and scene.
        limits: Limits to keep; the setting's limits when left out.
        content: What is asked for: further sections, without the keys whose values are None.
        arms: Section of the arms.
        samples: Files of points by name.
    """
    model, shapes = setting.model, file_shapes(setting.scene)
    unnamed = model.description.altered or model.description.source == URDF_TEXT
    limits = limits_for(setting, limits) or Limits()
    sections: dict[str, Any] = {
        "robot": {
            "urdf": "robot.urdf" if unnamed else path_text(model.description.source),
            "end_effector": model.end_effector,
            "base": str(model.base) if model.on_table else None,
            "gravity": model.gravity or None,
            "held": {name: float(value) for name, value in model.fixed_joints.items()},
            "arms": arms or None,
        },
        "momentum": setting.momentum.tolist(),
        **content,
        "limits": limits_content(limits, model.joint_names),
        "scene": scene_content(setting.scene),
    }
    if setting.wheel_momentum.any():
        sections["wheels"] = {"momentum": setting.wheel_momentum.tolist()}
    if setting.drifts:
        sections["drift"] = setting.drift.tolist()
    for name, section in sections.items():
        if isinstance(section, dict):
            sections[name] = {key: value for key, value in section.items() if value is not None}
    text = yaml.safe_dump(sections, sort_keys=False)
    return parse_scenario(text, Path("scenario.yaml"), samples or {}, model, shapes)
