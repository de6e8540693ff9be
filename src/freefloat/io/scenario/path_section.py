"""The ``path`` section of a scenario as a path, and a path as such a section."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np

from freefloat.dynamics.summary import frames_at
from freefloat.dynamics.tasks import Task
from freefloat.errors import InputError
from freefloat.io.scenario.field_types import quaternion_of, rotation_of
from freefloat.io.scenario.path_schema import (
    MOST_WAYPOINTS,
    AttitudeSection,
    FollowSection,
    FrameName,
    PathSection,
    curve_content,
    inexpressible,
)
from freefloat.io.scenario.yaml import file_keys
from freefloat.paths.curves import Curve, SplineCurve
from freefloat.paths.directed_orientation import DirectedOrientation
from freefloat.paths.orientation import (
    FixedOrientation,
    FreeOrientation,
    OrientationLaw,
    OrientationSpline,
    SlerpOrientation,
)
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.samples import parse_samples
from freefloat.paths.timed_path import TimedPath, path_key
from freefloat.planning.settings import Search
from freefloat.robot.model import FreeFloatingModel
from freefloat.rotations import Rotation
from freefloat.scene.scene import Scene
from freefloat.scene.scene_body import SceneBody
from freefloat.so3 import UPRIGHT, Array, Pose

SAMPLES = "samples.csv"
"""Name of the CSV file in a scenario that was made from a path of samples, unless it is another."""
_SAME_KNOT = 1e-12
"""Rounding of the knots of a spline."""
_INERTIAL = Pose(np.zeros(3), np.eye(3))


def frame_of(
    kind: FrameName | str,
    model: FreeFloatingModel,
    search: Search,
    scene: Scene,
    further: Sequence[float] | Array = (),
    joint: int = 0,
) -> Pose | SceneBody | None:
    """The frame of a path relative to the inertial one, at the present attitude and joints.

    Args:
        kind: The frame: ``spacecraft``, ``base``, a body of the scene, or a link of the spacecraft,
            which the arm does not move.
        model: Robot.
        search: Present attitude and joints.
        scene: Bodies beside the robot.
        further: Present joint values of arms on joint curves.
        joint: Number of the first joint of the arm that follows the path.

    Returns:
        None for the inertial frame; a tumbling body of the scene for its frame.

    Raises:
        InputError: If there is no such body, the search has no joints, or they do not suit the
            robot.
    """
    if kind is FrameName.INERTIAL:
        return None
    if kind in scene.names:
        body = scene.bodies[scene.names.index(kind)]
        return body.pose if body.motion == "fixed" else body
    number, place = model.link_places.get(kind, (None, _INERTIAL))
    if not isinstance(kind, FrameName) and number != 0:
        frames, root = ", ".join([*FrameName, *scene.names]), model.description.roots[0]
        accepted = f"{frames}, or a link of the spacecraft, such as {root}"
        raise InputError("path.frame", f"there is no {kind!r}", accepted)
    if search.joints is None:
        problem = f"{kind} needs search.joints, which is missing"
        raise InputError("path.frame", problem, "inertial, or the present joints in search.joints")
    joints = model.joint_vector(search.joints, "search.joints")[: model.dof - len(further)]
    joints, attitude = np.concatenate([joints, further]), search.from_attitude
    attitude = UPRIGHT if attitude is None else attitude
    if isinstance(kind, FrameName):
        return frames_at(model, attitude, joints, joint)[kind]
    return model.body_poses(attitude, joints)[0] @ place


def path_of(
    section: PathSection, task: Task, samples: Mapping[str, str], folder: Path, frame: Pose | None
) -> EndEffectorPath:
    """Path that a section describes.

    Args:
        section: The section.
        task: Part of the pose that it prescribes.
        samples: Texts of CSV files, among them the file of the section, by name.
        folder: Folder of the CSV files.
        frame: Frame of the section's coordinates, relative to the inertial frame; None for that
            frame.

    Raises:
        InputError: If the path is invalid, or lacks an orientation that the task needs.
    """
    curve: Curve
    sampled: OrientationLaw | None = None
    if section.samples is not None:
        curve, sampled = parse_samples(samples[section.samples], folder / section.samples)
    else:
        curve = section.to_curve()
    law: OrientationLaw = sampled or FreeOrientation()
    if section.attitude is not None:
        if sampled is not None:
            raise InputError("attitude", "the samples have quaternions, too", "one of the two")
        point_at = section.attitude.point_at
        if task is Task.POINTING and point_at is not None and not point_at.axis.endswith("z"):
            problem = f"{point_at.axis!r} was given, but task pointing prescribes the z axis"
            raise InputError("attitude.point_at.axis", problem, "z or -z")
        law = _law(section.attitude, curve)
    elif sampled is None and task.prescribes_orientation:
        problem = f"it is missing, task {task} needs it"
        raise InputError("attitude", problem, "fixed, slerp, follow or point_at")
    with file_keys(curve=section.kind):
        try:
            path = EndEffectorPath(curve, law)
        except InputError as error:
            if section.samples is None or error.key != "curve":
                raise
            problem = "the spline swings between its rows, which are too near for their rounding"
            raise InputError("curve", problem, "fewer rows, or more digits") from None
    with file_keys(curve="attitude.point_at"):
        return path if frame is None else path.moved(frame)


def _law(section: AttitudeSection, curve: Curve) -> OrientationLaw:
    if section.fixed is not None:
        return FixedOrientation(rotation_of(section.fixed, "attitude.fixed"))
    if section.slerp is not None:
        start = rotation_of(section.slerp.start, "attitude.slerp.from")
        return SlerpOrientation(start, rotation_of(section.slerp.end, "attitude.slerp.to"))
    if section.point_at is not None:
        point_at = section.point_at
        with file_keys(curve="attitude.point_at"):
            return DirectedOrientation.point_at(curve, point_at.axis, point_at.target)
    follow = cast(FollowSection, section.follow)  # exactly one of the four is given
    with file_keys(curve="attitude.follow", normal="attitude.follow.normal"):
        return DirectedOrientation.follow(curve, follow.axis, follow.normal)


def section_of(
    path: EndEffectorPath, samples: str = SAMPLES
) -> tuple[dict[str, Any], dict[str, str]]:
    """Content of the ``path`` section that describes a path, and texts of CSV files by name.

    Args:
        path: The path.
        samples: Name of the CSV file of a path of samples.

    Raises:
        InputError: If scenario files cannot describe the path: its curve or orientation is of a
            class of the user's.
    """
    curve, law = path.curve, path.orientation
    if isinstance(curve, SplineCurve):
        sampled = isinstance(law, OrientationSpline)
        dwells = not np.diff(curve.points, axis=0).any(axis=1).all()
        many = dwells or len(curve.points) > MOST_WAYPOINTS
        if sampled or many or not np.array_equal(curve.knots, SplineCurve(curve.points).knots):
            attitude = {} if sampled else _attitude_section(law)
            return {"samples": samples, **attitude}, {samples: _csv_text(curve, law)}
    return curve_content(curve) | _attitude_section(law), {}


def sections_of_arms(path: TimedPath) -> dict[str, dict[str, Any]]:
    """Contents of the ``path`` sections of further arms that follow paths, by name.

    Raises:
        InputError: As for :func:`section_of`, or if a path is one of samples.
    """
    contents = {}
    for name, arm_path in [*path.by_arm.items()][1:]:
        curve, law = arm_path.stated[0].curve, arm_path.stated[0].orientation
        if isinstance(curve, SplineCurve) and not np.allclose(
            curve.knots, SplineCurve(curve.points).knots, rtol=0.0, atol=_SAME_KNOT
        ):
            raise inexpressible(f"{path_key(name)}.curve", curve)
        contents[name] = curve_content(curve) | _attitude_section(law)
        if arm_path.frame is not None:
            contents[name]["frame"] = arm_path.frame
    return contents


def _csv_text(curve: SplineCurve, law: OrientationLaw) -> str:
    columns = [curve.knots[:, None], curve.points]
    names = ["s", "x", "y", "z"]
    if isinstance(law, OrientationSpline):
        columns.append(Rotation.from_matrix(law.rotation(curve.knots)).as_quat())
        names += ["qx", "qy", "qz", "qw"]
    stream = io.StringIO(newline="")
    csv.writer(stream, lineterminator="\n").writerows([names, *np.hstack(columns).tolist()])
    return stream.getvalue()


def _attitude_section(law: OrientationLaw) -> dict[str, Any]:
    content: dict[str, Any]
    if isinstance(law, FreeOrientation):
        return {}
    if isinstance(law, FixedOrientation):
        content = {"fixed": quaternion_of(law.axes)}
    elif isinstance(law, SlerpOrientation):
        content = {"slerp": {"from": quaternion_of(law.start), "to": quaternion_of(law.end)}}
    elif isinstance(law, DirectedOrientation) and law.target is not None:
        content = {"point_at": {"target": law.target.tolist(), "axis": law.axis}}
    elif isinstance(law, DirectedOrientation):
        content = {"follow": {"axis": law.axis, "normal": law.reference.tolist()}}
    else:
        raise inexpressible("path.attitude", law)
    return {"attitude": content}
