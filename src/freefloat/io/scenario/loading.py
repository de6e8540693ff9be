"""Scenarios and robots of YAML files and texts."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from freefloat.errors import InputError
from freefloat.io.scenario.robot_section import RobotFile
from freefloat.io.scenario.scenario import Scenario
from freefloat.io.scenario.scene_section import FileShapes
from freefloat.io.scenario.schema import OF_PATHS, ScenarioFile
from freefloat.io.scenario.yaml import error_context, parse_yaml, read_text, validated
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.named_files import find_scenario


def load_scenario(name: str | Path | dict[str, Any]) -> Scenario:
    """Scenario of a file, or of a dictionary with the keys of one.

    Args:
        name: A file, the name of a bundled scenario such as ``spatial_6dof/line``, or a dictionary,
            whose numbers may be NumPy's and whose paths are relative to the working folder.

    Raises:
        InputError: If it is invalid: file, line, key, value given and values accepted.

    Example:
        >>> scenario = ff.load_scenario("spatial_6dof/line")
        >>> scenario.problem().path.duration
        100.0
    """
    if isinstance(name, dict):
        plain = json.loads(json.dumps(name, default=_plain))
        return parse_scenario(yaml.safe_dump(plain, sort_keys=False), Path("scenario"))
    source = find_scenario(str(name))
    return parse_scenario(read_text(source), source)


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)


def load_robot(name: str | Path) -> tuple[FreeFloatingModel, list[Path]]:
    """The robot of a scenario, or of a file with nothing but ``robot``, and the files of both.

    Raises:
        InputError: As for :func:`load_scenario`.
    """
    source = find_scenario(str(name))
    text = read_text(source)
    data = parse_yaml(text, source)
    schema: type[RobotFile | ScenarioFile] = RobotFile if list(data) == ["robot"] else ScenarioFile
    robot = validated(schema, data, source, text).robot
    return robot.to_model(source), [source, *(Path(s.name) for s in robot.sources(source))]


def parse_scenario(
    text: str,
    source: Path,
    samples: Mapping[str, str] | None = None,
    robot: FreeFloatingModel | None = None,
    shapes: FileShapes | None = None,
) -> Scenario:
    """Scenario of a text.

    Args:
        text: Content of the file.
        source: The file: named in errors, and the folder of the files that the text names.
        samples: Texts of the CSV files of its paths, by name; default: read from the files.
        robot: The robot; default: the robot of the files that the scenario names.
        shapes: Shapes of bodies of the scene, likewise.

    Raises:
        InputError: As for :func:`load_scenario`.
    """
    data = parse_yaml(text, source)
    content = validated(ScenarioFile, data, source, text)
    if content.goal is not None:
        given = [*data, *(f"search.{key}" for key in data.get("search") or ())]
        if unused := [key for key in given if key in OF_PATHS]:
            accepted = f"a scenario with a goal, without {', '.join(unused)}"
            with error_context(source):
                raise InputError(unused[0], "motions to a goal do not use it", accepted)
    if samples is None:
        samples = content.sample_texts(source.parent)
    return Scenario(source, text, content, samples, robot, shapes or {})
