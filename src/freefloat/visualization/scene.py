"""Scenes of motions: the robot and what is drawn beside it, moved by tracks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from meshcat import geometry as g
from scipy.spatial.transform import Rotation

from freefloat.errors import InputError
from freefloat.motion.motion import Motion
from freefloat.so3 import Array
from freefloat.visualization.body_poses import BodyPoses, body_poses_at
from freefloat.visualization.camera import first_view
from freefloat.visualization.colours import MarginColours
from freefloat.visualization.overlays import (
    AREAS,
    BASE_AXES,
    ITEMS,
    TIP_AXES,
    draw_areas,
    draw_axes,
    draw_centre,
    draw_ending,
    draw_path,
    draw_trail,
    thickness,
)
from freefloat.visualization.scene_builder import ROOT, Scene, SceneBuilder, node
from freefloat.visualization.visuals import RobotVisuals, bounding_box, robot_visuals
from freefloat.workspace.margin_curves import Workspace
from freefloat.workspace.regions import exact_workspace

ROBOT = "Robot"
_POINT = (0.95, 0.90, 0.25, 1.0)
_RATE, _PLAYBACK = 25.0, 30.0
"""Key frames per second of playback, and the seconds that a page takes at most at first."""
_MOST_KEYS = 6000
"""Of all motions together."""


def motion_scene(motions: Mapping[str, Motion], title: str = "freefloat") -> Scene:
    """Return the scene of some motions, each below a node with its name.

    Args:
        motions: By name.
        title: Of the page.

    Raises:
        InputError: If there is no motion, or they have not the same margin.
    """
    if not motions:
        raise InputError("motions", "none was given", "one motion or more, by name")
    nodes = [node(name) for name in motions]
    if len(set(nodes)) < len(nodes):
        raise InputError("motions", f"names alike: {', '.join(motions)}", "names that differ")
    _refuse_different_margins(motions)
    known: dict[str, RobotVisuals] = {}
    most = _MOST_KEYS // len(motions)
    sampled = [_Sampled.of(motion, known, most) for motion in motions.values()]
    colours = MarginColours.over(sampled[0].motion.problem.margin, [one.values for one in sampled])
    builder = SceneBuilder()
    scenes = [
        {"title": str(name), "node": path} | _draw(builder, path, one, colours)
        for name, path, one in zip(motions, nodes, sampled, strict=True)
    ]
    planar = sampled[0].motion.problem.task.planar
    return builder.scene({
        "title": title,
        "duration": float(max(one.times[-1] for one in sampled)),
        "scenes": scenes,
        "items": [{"name": item, "visible": item != AREAS or planar} for item in (ROBOT, *ITEMS)],
        "scale": colours.to_dict(),
        "view": _view(sampled, planar),
        "remarks": list(dict.fromkeys(text for one in sampled for text in one.visuals.problems)),
    })  # fmt: skip


def _refuse_different_margins(motions: Mapping[str, Motion]) -> None:
    """A page has one colour scale, one margin and one view."""
    margins = {}
    for name, motion in motions.items():
        margin = motion.problem.margin
        where = "in the plane" if motion.problem.task.planar else "in space"
        margins[name] = f"{margin.measure.name} {margin.threshold:.6g} {where}"
    first, *others = margins
    for name in others:
        if margins[name] != margins[first]:
            raise InputError(
                "motions", f"the margin of {first} is {margins[first]}, that of {name} "
                f"{margins[name]}", "motions with the same measure and margin on one page",
            )  # fmt: skip


def key_times(motion: Motion, most: int = _MOST_KEYS) -> Array:
    """Return times at which the poses of a motion are recorded [s], shape (K,).

    They are evenly spread, 25 for each second of playback, and those of the motion's nodes, which
    crowd towards singularities; numbers of single precision, as the viewer has them.

    Args:
        motion: The motion.
        most: Number of evenly spread times, and of nodes, at the most.
    """
    first, last = float(motion.times.min()), float(motion.times.max())
    count = min(int(np.ceil(_RATE * min(last - first, _PLAYBACK))) + 1, most // 2)
    nodes = motion.times[:: 1 + 2 * len(motion.times) // most]
    times = np.concatenate([np.linspace(first, last, count), nodes]).astype(np.float32)
    return np.unique(np.clip(times.astype(float), first, last))


@dataclass(frozen=True, eq=False)
class _Sampled:
    """A motion at its key times: body poses, values of the measure, place on the path."""

    motion: Motion
    visuals: RobotVisuals
    times: Array
    poses: BodyPoses
    values: Array
    fractions: Array
    areas: Workspace | None

    @classmethod
    def of(cls, motion: Motion, known: dict[str, RobotVisuals], most: int) -> _Sampled:
        problem, times = motion.problem, key_times(motion, most)
        parameters = motion.parameter_at(times)
        ends = [motion.times.min(), motion.times.max()]
        parameters[[0, -1]] = motion.parameter_at(ends)  # to rounding: singularities are ends
        _, poses = body_poses_at(motion, parameters)
        measure, joints = problem.margin.measure, motion.evaluate(parameters)[2]
        values = np.abs([measure(q) for q in joints])
        fractions = np.array([problem.path.timing.s(float(t)) for t in times])
        model = problem.model
        key = f"{model.end_effector} {dict(model.held)} {model.description.text}"
        if key not in known:
            known[key] = robot_visuals(model)
        return cls(motion, known[key], times, poses, values, fractions, exact_workspace(problem))


def _draw(
    builder: SceneBuilder, name: str, sampled: _Sampled, colours: MarginColours
) -> dict[str, Any]:
    """Draw a motion below the node with its name; return what the page must know of it."""
    root, motion, problem = f"{ROOT}/{name}", sampled.motion, sampled.motion.problem
    times, poses, areas = sampled.times, sampled.poses, sampled.areas
    bodies = [node(name) for name in problem.model.body_names]
    for visual in sampled.visuals.shapes:
        builder.visual(f"{root}/{ROBOT}/{bodies[visual.body]}/{node(visual.name)}", visual)
    for body, link in enumerate(bodies):
        path = f"{root}/{ROBOT}/{link}"
        builder.move(path, times, poses.positions[:, body], _quaternions(poses.rotations[:, body]))
    labels = draw_path(builder, root, problem)
    indices = draw_trail(builder, root, problem, poses.tips, colours(sampled.values))
    labels += draw_centre(builder, root, problem) + draw_ending(builder, root, motion)
    size = thickness(problem)
    for name, positions, rotations in (
        (BASE_AXES, poses.positions[:, 0], poses.rotations[:, 0]),
        (TIP_AXES, poses.tips, poses.tip_rotations),
    ):
        draw_axes(builder, f"{root}/{name}", 25.0 * size, 0.6 * size)
        builder.move(f"{root}/{name}", times, positions, _quaternions(rotations))
    if areas is not None:
        draw_areas(builder, root, problem, areas)
        path, points = f"{root}/{AREAS}/{areas.point}", poses.tips + poses.tip_rotations @ areas.tip
        builder.mesh(path, g.Sphere(2.0 * size), _POINT)
        builder.move(path, times, points, _quaternions(poses.tip_rotations))
    return {
        "begin": float(times[0]),
        "end": float(times[-1]),
        "ending": motion.ending.name.lower(),
        "verdict": motion.ending.value,
        "labels": labels,
        "trail": {
            "times": times.round(6).tolist(),
            "values": [float(f"{value:.6g}") for value in sampled.values],
            "fractions": sampled.fractions.round(6).tolist(),
            "indices": indices,
        },
        "areas": None if areas is None else areas.point,
    }


def _quaternions(rotations: Array) -> Array:
    return np.asarray(Rotation.from_matrix(rotations).as_quat())


def _view(sampled: Sequence[_Sampled], planar: bool) -> dict[str, Any]:
    """The first view; in the plane the whole reach is in it."""
    others = [np.zeros((1, 3))]
    if planar:
        compass = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]])
        others += [one.areas.reach[1] * compass for one in sampled if one.areas is not None]
    corners = [
        np.vstack([bounding_box(shape) for shape in one.visuals.shapes if shape.body == 0])
        for one in sampled
    ]
    return first_view([one.poses for one in sampled], corners, np.vstack(others), planar)
