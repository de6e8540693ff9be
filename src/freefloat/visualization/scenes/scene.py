"""Scenes of motions: the robots, their paths and trails, the animation and the first view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import scipy
from meshcat import geometry as g

from freefloat.errors import InputError
from freefloat.limits.contact import deepest_contact
from freefloat.motion.motion import Motion
from freefloat.motion.pointing import PointingLimit
from freefloat.motion.singularity import singular_event
from freefloat.regions.workspace import exact_workspace
from freefloat.rotations import Rotation
from freefloat.so3 import Array
from freefloat.visualization.scenes.description import (
    MarginColours,
    SceneDescription,
    TitledScene,
    Trail,
    View,
)
from freefloat.visualization.scenes.overlays import (
    AREAS,
    BASE_AXES,
    END_EFFECTOR_AXES,
    ITEMS,
    SIDES,
    TABLE,
    TRAIL,
    draw_areas,
    draw_axes,
    draw_centre,
    draw_ending,
    draw_path,
    draw_table,
    draw_trail,
    thickness,
)
from freefloat.visualization.scenes.sampled_motion import (
    MAX_KEYS,
    POINTING,
    SampledMotion,
    with_drawn_path,
)
from freefloat.visualization.scenes.scene_builder import ROOT, PageScene, SceneBuilder, node
from freefloat.visualization.scenes.visuals import (
    bounding_box,
    robot_visuals,
    tip_links,
    view_direction,
)

ROBOT = "Robot"


@dataclass(frozen=True)
class Place:
    """When and where the coordinates of a motion begin.

    Attributes:
        start: Time of all motions together at which its time is zero [s].
        origin: Place of the centre of mass then [m].
    """

    start: float = 0.0
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)


_POINT_COLOUR = (0.95, 0.90, 0.25, 1.0)
_AXIS = 11.0
"""Length of the axes of a frame over the thickness of lines."""
_INSTANTS = 25
"""Instants of a motion that the view covers."""


def motion_scene(
    motions: Mapping[str, Motion],
    title: str = "freefloat",
    pointing: Sequence[PointingLimit] = (),
    places: Sequence[Place] = (),
    violations: Mapping[str, str] | None = None,
) -> PageScene:
    """The scene of motions, each below a node with its name.

    Args:
        motions: Motions by name.
        title: Title of the page.
        pointing: Limits of pointing that are drawn with each motion.
        places: When and where each motion begins, if they follow one another.
        violations: What motions violate, by their names.

    Raises:
        InputError: If there is no motion, names coincide, or measures or margins differ.
    """
    nodes = [node(name) for name in motions]
    if not nodes or len(set(nodes)) < len(nodes):
        raise InputError("motions", f"names: {', '.join(motions)}", "motions with distinct names")
    in_sequence = bool(places)
    if not in_sequence:
        _require_same_margin(motions)
    visuals_of = cache(robot_visuals)
    areas_of = cache(exact_workspace)
    axes, limit = tuple(pointing), MAX_KEYS // len(nodes)
    samples = [
        SampledMotion.of(
            motion, visuals_of(motion.problem.model), areas_of(motion.problem), axes, limit
        )
        for motion in map(with_drawn_path, motions.values())
    ]
    places = places or [Place()] * len(samples)
    start = places[0].start
    places = [replace(place, start=place.start - start) for place in places]
    problem = samples[0].motion.problem
    planar = problem.task.planar
    scale = MarginColours.over(problem.margin, [sampled.values for sampled in samples])
    builder = SceneBuilder()
    scenes = tuple(
        _draw(
            builder,
            name,
            sampled,
            replace(scale, margin=sampled.motion.problem.margin),
            place,
            (violations or {}).get(name, ""),
        )
        for name, sampled, place in zip(motions, samples, places, strict=True)
    )
    others = dict.fromkeys(item for sampled in samples for item in sampled.surroundings.items)
    others |= {POINTING: None} if pointing else {}
    others |= {TABLE: None} if problem.model.on_table else {}
    items = {item: item != AREAS or planar for item in (ROBOT, *ITEMS, *others)}
    remarks = dict.fromkeys(
        text
        for sampled in samples
        for text in (*sampled.visuals.problems, *sampled.surroundings.problems)
    )
    view = _view(samples, places, planar)
    about = SceneDescription(
        title, scenes, items, scale, view, tuple(remarks), sequence=in_sequence, start=start
    )
    return builder.scene(about)


def _require_same_margin(motions: Mapping[str, Motion]) -> None:
    """Raise InputError unless the motions share the measure, the margin and the dimension."""
    margins: dict[str, str] = {}
    for name, motion in motions.items():
        margin = motion.problem.margin
        dimension = "planar" if motion.problem.task.planar else "spatial"
        margins.setdefault(f"{margin.measure.name} {margin.threshold:.6g} ({dimension})", name)
    if len(margins) > 1:
        problem = "; ".join(f"the margin of {name} is {margin}" for margin, name in margins.items())
        accepted = "motions with the same measure and margin, which share a colour scale"
        raise InputError("motions", problem, accepted)


def _draw(
    builder: SceneBuilder,
    title: str,
    sampled: SampledMotion,
    colours: MarginColours,
    place: Place,
    violation: str,
) -> TitledScene:
    """Draw a motion below the node of its title; return its description."""
    motion = sampled.motion
    builder.start = place.start
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
    labels += draw_centre(builder, root, problem) + draw_ending(builder, root, motion)
    labels += sampled.surroundings.draw(builder, root)
    labels += [cone.draw(builder, root, size) for cone in sampled.cones]
    moved = {path: body for body, path in enumerate(bodies)}
    axes = {BASE_AXES: 0}
    for body, link in enumerate(tip_links(problem.model), len(bodies)):
        axes[f"{END_EFFECTOR_AXES}/{node(link)}"] = body
        path = f"{root}/{TRAIL}/{node(link)}"
        draw_trail(builder, path, problem, positions[body], colours(sampled.values))
    for item, body in axes.items():
        draw_axes(builder, f"{root}/{item}", _AXIS * size, 0.5 * size)
        moved[f"{root}/{item}"] = body
    for path, body in moved.items():
        builder.move(path, times, positions[body], quaternions[body])
    if problem.model.on_table:
        draw_table(builder, root, _swept_corners(sampled, body=0))
    if areas is not None:
        draw_areas(builder, root, problem, areas)
        path = f"{root}/{AREAS}/{areas.point}"
        builder.mesh(path, g.Sphere(2.0 * size), _POINT_COLOUR)
        points = positions[-1] + sampled.rotations[:, -1] @ areas.offset
        builder.move(path, times, points, quaternions[-1])
    model, joints = problem.model, sampled.joints.T.round(5).tolist()
    trail = Trail(
        (place.start + times).round(6).tolist(),
        [float(f"{value:.6g}") for value in sampled.values],
        sampled.fractions.round(6).tolist() if motion.curve is None else None,
        6 * SIDES,
        list(zip(model.joint_names, model.prismatic.tolist(), joints, strict=True)),
    )
    contact = deepest_contact(motion)
    return TitledScene(
        title,
        node(title),
        labels,
        begin=place.start + float(times[0]),
        end=place.start + float(times[-1]),
        origin=np.asarray(place.origin).round(6).tolist(),
        margin=problem.margin.threshold,
        ending=motion.ending.name.lower(),
        verdict=_verdict(motion),
        trail=trail,
        lines=tuple(filter(None, (violation, "" if contact is None else f"warning: {contact}"))),
    )


def _swept_corners(sampled: SampledMotion, body: int) -> Array:
    """Corners of a body along a motion, frame of the path [m], shape (K, 3)."""
    shapes = [shape for shape in sampled.visuals.shapes if shape.body == body]
    corners = np.vstack([bounding_box(shape) for shape in shapes])
    positions, rotations = sampled.positions[:, body, None], sampled.rotations[:, body]
    return (positions + corners @ rotations.swapaxes(1, 2)).reshape(-1, 3)


def _verdict(motion: Motion) -> str:
    """How a motion ended, with the kind of a singularity."""
    event = singular_event(motion)
    return motion.outcome if event is None else f"{motion.outcome} Kind: {event.kind}."


def _view(samples: Sequence[SampledMotion], places: Sequence[Place], planar: bool) -> View:
    """The page's first view, which covers the motions and, in the plane, the reach."""
    parts = [np.zeros((1, 3))]
    for sampled, place in zip(samples, places, strict=True):
        parts += [np.asarray(place.origin) + points for points in _extent(sampled)]
        if planar and sampled.areas is not None:
            axes = sampled.motion.problem.plane.axes[:, :2].T
            parts += [sampled.areas.reach[1] * axes, -sampled.areas.reach[1] * axes]
    points = np.vstack(parts)
    points = points[scipy.spatial.ConvexHull(points, qhull_options="QJ").vertices]
    centre = (points.min(axis=0) + points.max(axis=0)) / 2.0
    others = [place for sampled in samples for place in sampled.surroundings.places()]
    direction = view_direction([sampled.positions for sampled in samples], others)
    plane = samples[0].motion.problem.plane if planar else None
    level = plane is not None and plane.is_level
    if plane is not None:
        direction = np.array([0.0, -0.02, 1.0]) if level else plane.normal
    return View(
        centre=centre.round(4).tolist(),
        radius=float(np.linalg.norm(points - centre, axis=1).max()),
        points=points.round(4).tolist(),
        direction=direction.round(4).tolist(),
        flat=level,
    )


def _extent(sampled: SampledMotion) -> list[Array]:
    """Axes, corners of robot and scene, cones at some instants [m], shape (K, 3) each.

    Corners further from their body's origin than the arm is long, as those of solar panels, are
    left out.
    """
    problem = sampled.motion.problem
    chosen = np.unique(np.linspace(0, len(sampled.times) - 1, _INSTANTS).astype(int))
    positions, rotations = sampled.positions[chosen], sampled.rotations[chosen]
    length = np.linalg.norm(np.diff(positions[0], axis=0), axis=1).sum()
    parts = []
    for shape in sampled.visuals.shapes:
        corners = bounding_box(shape)
        near, k = corners[np.linalg.norm(corners, axis=1) <= length], shape.body
        parts.append(positions[:, k, None] + near @ rotations[:, k].swapaxes(1, 2))
    framed = [0, *range(len(problem.model.bodies), positions.shape[1])]
    axes = _AXIS * thickness(problem) * rotations[:, framed].swapaxes(2, 3)
    return [
        *(part.reshape(-1, 3) for part in (*parts, positions[:, framed, None] + axes)),
        *sampled.surroundings.extent(),
        *(cone.extent() for cone in sampled.cones),
    ]
