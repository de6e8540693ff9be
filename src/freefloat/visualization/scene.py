"""Motions as MeshCat commands: the robot and what is drawn beside it, moved by tracks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from meshcat import geometry as g
from scipy.spatial.transform import Rotation

from freefloat.errors import InputError
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.so3 import Array
from freefloat.visualization.body_poses import BodyPoses, body_poses_at
from freefloat.visualization.camera import first_view
from freefloat.visualization.colours import MarginColours
from freefloat.visualization.key_frames import key_times
from freefloat.visualization.overlays import (
    AREAS,
    BASE_AXES,
    HAND_AXES,
    ITEMS,
    draw_areas,
    draw_axes,
    draw_centre,
    draw_ending,
    draw_path,
    draw_trail,
    thickness,
)
from freefloat.visualization.robot_drawing import corners, draw_robot
from freefloat.visualization.stage import ROOT, Stage, node
from freefloat.visualization.visuals import Look, look_of
from freefloat.workspace.margin_curves import Workspace
from freefloat.workspace.regions import exact_workspace

ROBOT = "Robot"
_POINT = (0.95, 0.90, 0.25, 1.0)
_COMPASS = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
_KEYS, _RINGS = 10_000, 1600
"""Of all motions together, at the most."""
_FEWEST_RINGS = 100
"""Of a trail."""
_SKY = {"top_color": [0.10, 0.13, 0.20], "bottom_color": [0.02, 0.03, 0.05]}


@dataclass(frozen=True, eq=False)
class Recording:
    """A scene, its motions, and what a page must know to show them.

    Attributes:
        objects: Commands that make the scene, msgpack, in order.
        copies: Paths whose object is to be that of another path: from, to.
        animation: The command that gives it its tracks; None where nothing moves.
        about: Titles, labels, the colour scale and the first view, as JSON knows them.
    """

    objects: tuple[bytes, ...]
    copies: tuple[tuple[str, str], ...]
    animation: bytes | None
    about: Mapping[str, Any]


def record(motions: Mapping[str, Motion], title: str = "freefloat") -> Recording:
    """Record motions, each below a node of the scene tree with its name.

    Bodies are where the motions say to 1e-6 m at all times, but for the last 0.1 ms before a
    singularity, where rates by time have no bound. Many motions together are told more coarsely,
    to some 1e-5 m, so that a page stays small.

    Args:
        motions: By name.
        title: Of the page.

    Raises:
        InputError: If there is no motion, or they have not the same margin.
    """
    if not motions:
        raise InputError("motions", "none was given", "one motion or more, by name")
    stage = Stage()
    forward = {node(name): _forward(motion) for name, motion in motions.items()}
    if len(forward) < len(motions):
        raise InputError("motions", f"names alike: {', '.join(motions)}", "names that differ")
    _refuse_what_differs(forward)
    looks: dict[str, Look] = {}
    most, rings = _KEYS // len(forward), max(_FEWEST_RINGS, _RINGS // len(forward))
    acted = {name: _Act.of(motion, looks, most) for name, motion in forward.items()}
    set_the_stage(stage)
    first = next(iter(forward.values())).problem
    colours = MarginColours.over(first.margin, [act.values for act in acted.values()])
    scenes = [
        {"title": str(title), "node": name} | _perform(stage, name, act, colours, rings)
        for title, (name, act) in zip(motions, acted.items(), strict=True)
    ]
    duration = float(max(act.times[-1] for act in acted.values()))
    about = {
        "title": title,
        "duration": duration,
        "scenes": scenes,
        "items": _items(first),
        "scale": colours.document(),
        "view": _view(first, list(acted.values())),
        "remarks": list(dict.fromkeys(one for act in acted.values() for one in act.look.missing)),
    }
    return Recording(stage.objects, stage.copies, stage.animation(duration), about)


def _refuse_what_differs(motions: Mapping[str, Motion]) -> None:
    """One scale of colours, one margin and one view must suit all motions of a page."""
    wishes = {}
    for name, motion in motions.items():
        margin = motion.problem.margin
        plane = "in the plane" if motion.problem.task.planar else "in space"
        wishes[name] = f"{margin.measure.name} {margin.threshold:.6g} {plane}"
    first, *others = wishes
    for name in others:
        if wishes[name] != wishes[first]:
            raise InputError(
                "motions", f"{first} keeps {wishes[first]}, {name} keeps {wishes[name]}",
                "motions with the same measure and margin on one page",
            )  # fmt: skip


def _forward(motion: Motion) -> Motion:
    if motion.times[-1] >= motion.times[0]:
        return motion
    turned = (values[::-1] for values in (motion.times, motion.attitudes, motion.joints))
    return Motion(motion.problem, motion.ending, *turned)


@dataclass(frozen=True, eq=False)
class _Act:
    """A motion sampled for drawing: body poses at its key times, magnitudes of the measure."""

    motion: Motion
    look: Look
    times: Array
    poses: BodyPoses
    values: Array
    areas: Workspace | None

    @classmethod
    def of(cls, motion: Motion, looks: dict[str, Look], most: int) -> _Act:
        """Sample a motion; robots that were looked at before are not looked at again."""
        times = _single_precision(motion, most)
        places = motion.parameter_at(times)
        places[[0, -1]] = motion.node_parameters[
            [0, -1]
        ]  # near a singularity a microsecond matters
        _, poses = body_poses_at(motion, places)
        problem = motion.problem
        values = np.abs([problem.margin.measure(q) for q in motion.joints])
        model = problem.model
        key = f"{model.end_effector} {dict(model.held)} {model.description.text}"
        look = looks.setdefault(key, looks.get(key) or look_of(model))
        return cls(motion, look, times, poses, values, exact_workspace(problem))


def _single_precision(motion: Motion, most: int) -> Array:
    """Key times that a browser knows exactly, each once, none outside the motion."""
    times = key_times(motion, most=most)
    rounded = np.unique(times.astype(np.float32)).astype(float)
    return np.asarray(rounded[(rounded >= times[0]) & (rounded <= times[-1])])


def set_the_stage(stage: Stage) -> None:
    """No floor in orbit; lamps that reach far."""
    for path in ("Grid", "Axes"):
        stage.set(path, "visible", False)
    for key, value in _SKY.items():
        stage.set("Background", key, value)
    for lamp in ("PointLightNegativeX", "PointLightPositiveX"):
        stage.set(f"Lights/{lamp}/<object>", "distance", 0.0)
        stage.set(f"Lights/{lamp}/<object>", "intensity", 0.25)


def _perform(
    stage: Stage, name: str, act: _Act, colours: MarginColours, rings: int
) -> dict[str, Any]:
    """Draw and move all that belongs to one motion; what the page must know of it."""
    root, motion, problem = f"{ROOT}/{name}", act.motion, act.motion.problem
    names = [node(name) for name in problem.model.body_names]
    draw_robot(stage, f"{root}/{ROBOT}", names, act.look)
    for body, link in enumerate(names):
        turns = Rotation.from_matrix(act.poses.rotations[:, body]).as_quat()
        stage.move(f"{root}/{ROBOT}/{link}", act.times, act.poses.positions[:, body], turns)
    labels = draw_path(stage, root, problem)
    trail = draw_trail(stage, root, motion, act.times, colours, rings)
    if act.areas is not None:
        draw_areas(stage, root, problem, act.areas)
    labels += draw_centre(stage, root, problem) + draw_ending(stage, root, motion)
    size = thickness(problem)
    hands = Rotation.from_matrix(act.poses.hands).as_quat()
    base = Rotation.from_matrix(act.poses.rotations[:, 0]).as_quat()
    for name, places, turns in (
        (BASE_AXES, act.poses.positions[:, 0], base),
        (HAND_AXES, act.poses.tips, hands),
    ):
        draw_axes(stage, f"{root}/{name}", 25.0 * size, 0.6 * size)
        stage.move(f"{root}/{name}", act.times, places, turns)
    if act.areas is not None:
        point = act.poses.tips + act.poses.hands @ act.areas.tip
        path = f"{root}/{AREAS}/{act.areas.point}"
        stage.mesh(path, g.Sphere(2.0 * size), _POINT)
        stage.move(path, act.times, point, hands)
    return {
        "begin": float(act.times[0]),
        "end": float(act.times[-1]),
        "ending": motion.ending.name.lower(),
        "verdict": motion.ending.value,
        "labels": labels,
        "trail": {
            "times": [round(float(t), 6) for t in trail.times],
            "values": [float(f"{value:.6g}") for value in trail.values],
            "fractions": [round(float(s), 6) for s in trail.fractions],
            "indices": trail.indices,
        },
        "areas": None if act.areas is None else act.areas.point,
    }


def _items(problem: Problem) -> list[dict[str, Any]]:
    """What can be shown and hidden; in space the areas hide too much at first."""
    return [
        {"name": name, "visible": name != AREAS or problem.task.planar} for name in (ROBOT, *ITEMS)
    ]


def _view(problem: Problem, acts: Sequence[_Act]) -> dict[str, Any]:
    """The first look, as JSON knows it; in the plane it takes in the areas, too."""
    flat = problem.task.planar
    beside = [np.zeros((1, 3))]
    for act in acts:
        if flat and act.areas is not None:
            beside.append(
                act.areas.reach[1]
                * np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]])
            )
    bus = [corners(act.look, 0) for act in acts]
    view = first_view([act.poses for act in acts], bus, np.vstack(beside), flat)
    return asdict(view)
