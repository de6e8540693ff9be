"""Scenes of motions: the robots, their paths and trails, the animation and the first view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from meshcat import geometry as g
from scipy.spatial.transform import Rotation

from freefloat.errors import InputError
from freefloat.limits.contact import self_contact
from freefloat.motion.motion import Motion
from freefloat.motion.pointing import PointingLimit
from freefloat.motion.singularity import singular_event
from freefloat.paths.tumbling import Tumbling
from freefloat.so3 import Array
from freefloat.visualization.description import (
    MarginColours,
    SceneDescription,
    TitledScene,
    Trail,
    View,
)
from freefloat.visualization.overlays import (
    AREAS,
    BASE_AXES,
    END_EFFECTOR_AXES,
    ITEMS,
    draw_areas,
    draw_axes,
    draw_centre,
    draw_ending,
    draw_path,
    draw_trail,
    thickness,
)
from freefloat.visualization.pointing_cones import POINTING, PointingCone
from freefloat.visualization.scene_builder import ROOT, Scene, SceneBuilder, node
from freefloat.visualization.surroundings import Surroundings
from freefloat.visualization.visuals import (
    RobotVisuals,
    body_poses,
    bounding_box,
    robot_visuals,
    view_direction,
)
from freefloat.workspace.regions import Workspace, exact_workspace

ROBOT = "Robot"
_POINT_COLOUR = (0.95, 0.90, 0.25, 1.0)
_RATE, _PLAYBACK, _PER_TURN = 25.0, 30.0, 12.0
"""Key frames per second of playback; longest initial playback time [s]; frames per revolution."""
_MAX_KEYS = 6000
"""Key frames of all motions together."""
_INSTANTS = 25
"""Instants of a motion that the view covers."""


def motion_scene(
    motions: Mapping[str, Motion],
    title: str = "freefloat",
    pointing: Sequence[PointingLimit] = (),
) -> Scene:
    """Return the scene of motions, each below a node with its name.

    Args:
        motions: Motions by name.
        title: Title of the page.
        pointing: Limits of pointing that are drawn with each motion.

    Raises:
        InputError: If there is no motion, names coincide, or measures or margins differ.
    """
    nodes = [node(name) for name in motions]
    if not nodes or len(set(nodes)) < len(nodes):
        raise InputError("motions", f"names: {', '.join(motions)}", "motions with distinct names")
    _require_same_margin(motions)
    visuals_of = cache(robot_visuals)
    areas_of = cache(exact_workspace)
    limit = _MAX_KEYS // len(nodes)
    samples = [
        _sampled(
            motion, visuals_of(motion.problem.model), areas_of(motion.problem), limit, pointing
        )
        for motion in motions.values()
    ]
    problem = samples[0].motion.problem
    planar = problem.task.planar
    colours = MarginColours.over(problem.margin, [sampled.values for sampled in samples])
    builder = SceneBuilder()
    scenes = tuple(
        _draw(builder, name, sampled, colours)
        for name, sampled in zip(motions, samples, strict=True)
    )
    others = dict.fromkeys(item for sampled in samples for item in sampled.surroundings.items)
    others |= {POINTING: None} if pointing else {}
    items = {item: item != AREAS or planar for item in (ROBOT, *ITEMS, *others)}
    remarks = dict.fromkeys(
        text
        for sampled in samples
        for text in (*sampled.visuals.problems, *sampled.surroundings.problems)
    )
    view = _view(samples, planar)
    return builder.scene(SceneDescription(title, scenes, items, colours, view, tuple(remarks)))


def _require_same_margin(motions: Mapping[str, Motion]) -> None:
    """Raise InputError unless the motions share the measure, the margin and the dimension."""
    margins: dict[str, str] = {}
    for name, motion in motions.items():
        margin = motion.problem.margin
        dimension = "planar" if motion.problem.task.planar else "spatial"
        margins.setdefault(f"{margin.measure.name} {margin.threshold:.6g} ({dimension})", name)
    if len(margins) > 1:
        problem = "; ".join(f"the margin of {name} is {margin}" for margin, name in margins.items())
        raise InputError("motions", problem, "motions with the same measure and margin")


def key_times(motion: Motion, limit: int = _MAX_KEYS) -> Array:
    """Return the times of a motion's key frames [s], shape (K,), in single precision.

    The union of evenly spaced times, 25 per second of playback and 12 per revolution of a tumbling
    body, and of the integration nodes, which are dense near singularities.

    Args:
        motion: The motion.
        limit: Maximum number of key frames.
    """
    first, last = float(motion.times.min()), float(motion.times.max())
    bodies = motion.problem.scene.bodies
    tumbling = [body.motion for body in bodies if isinstance(body.motion, Tumbling)]
    turns = max((body.revolutions(last - first) for body in tumbling), default=0.0)
    count = int(np.ceil(max(_RATE * min(last - first, _PLAYBACK), _PER_TURN * turns))) + 1
    count = min(count, limit // 2)
    nodes = motion.times[:: 1 + 2 * len(motion.times) // limit]
    times = np.concatenate([np.linspace(first, last, count), nodes]).astype(np.float32)
    return np.unique(np.clip(times.astype(float), first, last))


@dataclass(frozen=True, eq=False)
class _Sampled:
    """A motion at its key times: poses of bodies and end-effector, |measure|, s, surroundings."""

    motion: Motion
    visuals: RobotVisuals
    times: Array
    positions: Array
    rotations: Array
    values: Array
    fractions: Array
    areas: Workspace | None
    surroundings: Surroundings
    cones: tuple[PointingCone, ...]


def _sampled(
    motion: Motion,
    visuals: RobotVisuals,
    areas: Workspace | None,
    limit: int,
    pointing: Sequence[PointingLimit],
) -> _Sampled:
    problem = motion.problem
    times = key_times(motion, limit)
    parameters = motion.coordinate_at(times)
    # Exact end points: a singular motion has no state after its end.
    parameters[[0, -1]] = motion.coordinate_at([motion.times.min(), motion.times.max()])
    measure = problem.margin.measure
    poses = body_poses(motion, parameters)
    return _Sampled(
        motion,
        visuals,
        times,
        *poses,
        np.abs([measure(q) for q in motion.evaluate(parameters)[2]]),
        np.array([problem.path.timing.s(float(t)) for t in times]),
        areas,
        Surroundings.of(problem, times),
        tuple(
            PointingCone.of(problem, axis, number, times, poses, visuals)
            for number, axis in enumerate(pointing)
        ),
    )


def _draw(
    builder: SceneBuilder, title: str, sampled: _Sampled, colours: MarginColours
) -> TitledScene:
    """Draw a motion below the node of its title; return its description."""
    motion = sampled.motion
    problem = motion.problem
    root = f"{ROOT}/{node(title)}"
    times = sampled.times
    areas = sampled.areas
    size = thickness(problem)
    positions = sampled.positions.swapaxes(0, 1)
    quaternions = [
        Rotation.from_matrix(sampled.rotations[:, body]).as_quat() for body in range(len(positions))
    ]
    bodies = [f"{root}/{ROBOT}/{node(link)}" for link in problem.model.body_names]
    for visual in sampled.visuals.shapes:
        builder.visual(f"{bodies[visual.body]}/{node(visual.name)}", visual)
    labels = draw_path(builder, root, problem)
    indices = draw_trail(builder, root, problem, positions[-1], colours(sampled.values))
    labels += draw_centre(builder, root, problem) + draw_ending(builder, root, motion)
    labels += sampled.surroundings.draw(builder, root)
    labels += [cone.draw(builder, root, size) for cone in sampled.cones]
    moved = {path: body for body, path in enumerate(bodies)}
    for item, body in ((BASE_AXES, 0), (END_EFFECTOR_AXES, -1)):
        draw_axes(builder, f"{root}/{item}", 25.0 * size, 0.6 * size)
        moved[f"{root}/{item}"] = body
    for path, body in moved.items():
        builder.move(path, times, positions[body], quaternions[body])
    if areas is not None:
        draw_areas(builder, root, problem, areas)
        path = f"{root}/{AREAS}/{areas.point}"
        builder.mesh(path, g.Sphere(2.0 * size), _POINT_COLOUR)
        points = positions[-1] + sampled.rotations[:, -1] @ areas.offset
        builder.move(path, times, points, quaternions[-1])
    trail = Trail(
        times.round(6).tolist(),
        [float(f"{value:.6g}") for value in sampled.values],
        sampled.fractions.round(6).tolist(),
        indices,
    )
    contact = self_contact(motion)
    return TitledScene(
        title,
        node(title),
        labels,
        begin=float(times[0]),
        end=float(times[-1]),
        ending=motion.ending.name.lower(),
        verdict=_verdict(motion),
        trail=trail,
        lines=() if contact is None else (f"warning: {contact}",),
    )


def _verdict(motion: Motion) -> str:
    """Return how a motion ended, with the kind of a singularity."""
    event = singular_event(motion)
    return motion.ending.value if event is None else f"{motion.ending.value} Kind: {event.kind}."


def _view(samples: Sequence[_Sampled], planar: bool) -> View:
    """Return the page's first view, which covers the motions and, in the plane, the reach."""
    parts = [np.zeros((1, 3))]
    for sampled in samples:
        parts += _extent(sampled)
        if planar and sampled.areas is not None:
            axes = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]])
            parts.append(sampled.areas.reach[1] * axes)
    points = np.vstack(parts)
    centre = (points.min(axis=0) + points.max(axis=0)) / 2.0
    flat = np.array([0.0, -0.02, 1.0])
    others = [place for sampled in samples for place in sampled.surroundings.places()]
    direction = view_direction([sampled.positions for sampled in samples], others)
    return View(
        centre=centre.round(4).tolist(),
        radius=float(np.linalg.norm(points - centre, axis=1).max()),
        points=points.round(4).tolist(),
        direction=(flat if planar else direction).round(4).tolist(),
        flat=planar,
    )


def _extent(sampled: _Sampled) -> list[Array]:
    """Joints, end-effector, corners of spacecraft and scene, cones at some instants [m]."""
    chosen = np.unique(np.linspace(0, len(sampled.times) - 1, _INSTANTS).astype(int))
    positions, rotations = sampled.positions[chosen], sampled.rotations[chosen, 0]
    corners = [bounding_box(shape) for shape in sampled.visuals.shapes if shape.body == 0]
    box = np.einsum("kij,cj->kci", rotations, np.vstack(corners)) + positions[:, :1]
    cones = (cone.extent() for cone in sampled.cones)
    return [positions.reshape(-1, 3), box.reshape(-1, 3), *sampled.surroundings.extent(), *cones]
