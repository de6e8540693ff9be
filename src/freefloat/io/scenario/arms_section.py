"""The key ``robot.arms`` of scenario files: further arms, and what moves them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import scipy
from pydantic import Field

from freefloat.errors import InputError
from freefloat.io.scenario.field_types import Name, Number, Section
from freefloat.io.scenario.path_schema import PathSection
from freefloat.io.scenario.yaml import error_context, file_keys
from freefloat.motion.joint_curves import ArmCurve, ArmCurves
from freefloat.motion.problem import Problem
from freefloat.records import Tree
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array

_WAYPOINTS = 101
"""Waypoints of the joints of a saved motion."""
_SAVED = "a motion file of freefloat (-o)"

Waypoints = Annotated[list[list[Number]], Field(min_length=2, max_length=10_000)]


class JointsLaw(Section):
    """The arm's joints are prescribed."""

    joints: Name | Waypoints
    """Waypoints, each with a value for each joint [rad, m], on a spline from rest to rest; or a
    file with a motion of the joints, relative to the scenario file."""
    times: list[Number] | None = None
    """Times of the waypoints [s], rising from 0 to the duration; equal intervals when left out."""

    def to_curve(
        self, key: str, joints: tuple[str, ...], folder: Path, duration: float
    ) -> ArmCurve:
        """The curve of joints with these names along a path of a duration [s]."""
        if isinstance(self.joints, str):
            if self.times is not None:
                problem = "it is given for the joints of a file, which have times"
                raise InputError(f"{key}.times", problem, "no such key, or waypoints")
            with file_keys(waypoints=f"{key}.joints", times=f"{key}.joints"):
                return _saved_curve(folder / self.joints, f"{key}.joints", joints)
        for number, point in enumerate(self.joints):
            if len(point) != len(joints):
                problem = f"{len(point)} values were given"
                accepted = f"one of each: {', '.join(joints)}"
                raise InputError(f"{key}.joints.{number}", problem, accepted)
        with file_keys(waypoints=f"{key}.joints", times=f"{key}.times"):
            if self.times is None:
                return ArmCurve.evenly(self.joints, duration)
            return ArmCurve(np.array(self.joints), np.array(self.times))


class OwnPathLaw(Section):
    """The arm follows a path of its own."""

    path: PathSection
    """A path without samples; task and timing are the scenario's."""


class ArmSection(Section):
    """An arm beside others."""

    end_effector: Name
    """Last link of the arm."""
    law: Literal["held"] | JointsLaw | OwnPathLaw | None = None
    """What moves it: ``held``, the default, nothing: its joints keep the values of ``robot.held``,
    or zero; ``{joints: ...}``, a joint curve; ``{path: ...}``, a path of its own. The arm that
    follows the scenario's path has no law."""


def curves_of(
    arms: Mapping[str, ArmSection], model: FreeFloatingModel, scenario: Path, duration: float
) -> ArmCurves:
    """The joint curves of a robot's arms along a path of a duration [s].

    Raises:
        InputError: If a curve is invalid; it names the scenario file and the key.
    """
    curves = {}
    with error_context(scenario):
        for name in model.arms:
            law, key = arms[name].law, f"robot.arms.{name}.law"
            if isinstance(law, JointsLaw):
                joints = model.joints_of_arm(name)
                curves[name] = law.to_curve(key, joints, scenario.parent, duration)
    return ArmCurves(curves)


def arms_content(problem: Problem, paths: Mapping[str, dict[str, Any]]) -> dict[str, Any]:
    """The content of the key for arms that move; arms on paths have the content of these paths."""
    laws: dict[str, dict[str, Any]] = {name: {"path": path} for name, path in paths.items()}
    for name, curve in problem.arms.curves.items():
        laws[name] = {"joints": curve.waypoints.tolist(), "times": curve.times.tolist()}
    links = problem.model.further_arms
    return {name: {"end_effector": links[name], "law": law} for name, law in laws.items()}


def _saved_curve(path: Path, key: str, joints: tuple[str, ...]) -> ArmCurve:
    """Joints of a saved motion, by name."""
    from freefloat.io.verified_hdf5 import read_hdf5  # h5py imports slowly

    try:
        tree = read_hdf5(path, _SAVED)
    except InputError as error:
        raise InputError(key, f"{path}: {error.problem}", error.accepted) from None
    times, values = next(_motions(tree), (np.zeros(0), np.zeros((0, 0))))
    names = [str(name) for name in getattr(tree.get("joint_names"), "values", np.zeros(0))]
    missing = [joint for joint in joints if joint not in names]
    if missing or len(times) < 2 or not (np.diff(times) > 0.0).all():
        problem = f"{path} has no motion of {', '.join(missing or joints)}"
        raise InputError(key, problem, _SAVED)
    columns = [names.index(joint) for joint in joints]
    spline = scipy.interpolate.CubicSpline(times, values[:, columns])
    instants = np.linspace(0.0, float(times[-1]), _WAYPOINTS)
    return ArmCurve(spline(instants), instants)


def _motions(tree: Tree) -> Iterator[tuple[Array, Array]]:
    """Times and joints of the motions in a tree of a result, the outermost first."""
    if "times" in tree and "joints" in tree and "attitudes" in tree:
        yield tree["times"].values, tree["joints"].values
    for part in tree.values():
        if isinstance(part, dict):
            yield from _motions(part)
