"""Scenes of motions, plans and simulations: robots, paths, trails, animation, first view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import scipy
from meshcat import geometry as g

from freefloat.errors import InputError
from freefloat.limits.limits import deepest_contact
from freefloat.motion.extrema import closest_approach
from freefloat.motion.motion import Motion
from freefloat.motion.pointing import AttitudeLimits
from freefloat.motion.singularity import singular_event
from freefloat.planning.plan import Plan
from freefloat.planning.simulation import Simulation
from freefloat.regions.workspace import exact_workspace
from freefloat.rotations import Rotation
from freefloat.so3 import Array
from freefloat.visualization.scenes import overlays
from freefloat.visualization.scenes.description import (
    MarginColours,
    SceneDescription,
    TitledScene,
    Trail,
    View,
)
from freefloat.visualization.scenes.sampled_motion import MAX_KEYS, POINTING, SampledMotion
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
        start: Time of all motions together, as the clock shows it, at which its time is zero [s].
        origin: Place of the centre of mass then [m].
    """

    start: float = 0.0
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)


_POINT_COLOUR = (0.95, 0.90, 0.25, 1.0)
_AXIS = 11.0
"""Length of the axes of a frame over the thickness of lines."""
_INSTANTS = 25
"""Instants of a motion that the view covers."""


def single_motion_scene(motion: Motion, title: str) -> PageScene:
    """The scene of a motion."""
    return motion_scene({"motion": motion}, title)


def simulation_scene(simulation: Simulation, title: str) -> PageScene:
    """The scene of all arm branches, the chosen one first."""
    chosen = simulation.chosen
    branches = sorted(simulation.branches, key=lambda branch: branch is not chosen)
    motions = {branch.title: branch.motion for branch in branches}
    violations = {chosen.title: simulation.violation}
    return motion_scene(motions, title, simulation.limits, violations=violations)


def plan_scene(plan: Plan, title: str) -> PageScene:
    """The scene of the chosen motion of a plan; an InputError without one."""
    if plan.chosen is None:
        raise InputError("plan", f"it has no motion: {plan.reason}", "a plan with a motion")
    name = plan.chosen.title
    violations = {name: "" if plan.feasible else plan.violation or "infeasible"}
    return motion_scene({name: plan.chosen.motion}, title, plan.limits, violations=violations)


def motion_scene(
    motions: Mapping[str, Motion],
    title: str = "freefloat",
    limits: AttitudeLimits | None = None,
    places: Sequence[Place] = (),
    violations: Mapping[str, str] | None = None,
) -> PageScene:
    """The scene of motions, each below a node with its name.

    Args:
        motions: Motions by name.
        title: Title of the page.
        limits: Limits, of which the limits of pointing are drawn with each motion.
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
    pointing = () if limits is None else limits.pointing
    limit = MAX_KEYS // len(nodes)
    samples = []
    for motion in motions.values():
        drawn = visuals_of(motion.model), areas_of(motion.setting)
        samples.append(SampledMotion.of(motion, *drawn, pointing, limit))
    places = places or [Place()] * len(samples)
    start = places[0].start
    setting = samples[0].motion.setting
    planar = setting.task.planar
    scale = MarginColours.over(setting.margin, [sampled.values for sampled in samples])
    builder = SceneBuilder()
    broken = violations or {}
    scenes = tuple(
        _draw(builder, name, sampled, scale, place, start, broken.get(name, ""))
        for name, sampled, place in zip(motions, samples, places, strict=True)
    )
    others = [item for sampled in samples for item in sampled.surroundings.items]
    others += [POINTING] * bool(pointing) + [overlays.TABLE] * setting.model.on_table
    items = {item: item != overlays.AREAS or planar for item in (ROBOT, *overlays.ITEMS, *others)}
    remarks = dict.fromkeys(
        text
        for sampled in samples
        for text in (*sampled.visuals.problems, *sampled.surroundings.problems)
    )
    view, legend = _view(samples, places, planar), scale.to_dict()
    about = SceneDescription(
        title, scenes, items, legend, view, tuple(remarks), sequence=in_sequence, start=start
    )
    return builder.scene(about)


def _require_same_margin(motions: Mapping[str, Motion]) -> None:
    """Raise InputError unless the motions share the measure, the margin and the dimension."""
    margins: dict[str, str] = {}
    for name, motion in motions.items():
        margin = motion.setting.margin
        dimension = "planar" if motion.setting.task.planar else "spatial"
        margins.setdefault(f"{margin.measure.name} {margin.threshold:.6g} ({dimension})", name)
    if len(margins) > 1:
        problem = "; ".join(f"the margin of {name} is {margin}" for margin, name in margins.items())
        accepted = "motions with the same measure and margin, which share a colour scale"
        raise InputError("motions", problem, accepted)


def _draw(
    builder: SceneBuilder,
    title: str,
    sampled: SampledMotion,
    scale: MarginColours,
    place: Place,
    first: float,
    violation: str,
) -> TitledScene:
    """Draw a motion below the node of its title; return its description.

    The clock shows ``first`` where the page begins [s].
    """
    builder.start, motion, setting = place.start - first, sampled.motion, sampled.motion.setting
    root = f"{ROOT}/{node(title)}"
    times, areas, size = sampled.times, sampled.areas, overlays.thickness(setting)
    colours = replace(scale, margin=setting.margin)
    positions = sampled.positions.swapaxes(0, 1)
    quaternions = [
        Rotation.from_matrix(sampled.rotations[:, body]).as_quat() for body in range(len(positions))
    ]
    bodies = [f"{root}/{ROBOT}/{node(link)}" for link in setting.model.body_names]
    for visual in sampled.visuals.shapes:
        builder.visual(f"{bodies[visual.body]}/{node(visual.name)}", visual)
    labels = overlays.draw_path(builder, root, motion)
    labels += overlays.draw_centre(builder, root, setting)
    labels += overlays.draw_ending(builder, root, motion, place.start)
    labels += sampled.surroundings.draw(builder, root)
    labels += [cone.draw(builder, root, size) for cone in sampled.cones]
    moved = {path: body for body, path in enumerate(bodies)}
    axes = {overlays.BASE_AXES: 0}
    for body, link in enumerate(tip_links(setting.model), len(bodies)):
        axes[f"{overlays.END_EFFECTOR_AXES}/{node(link)}"] = body
        path = f"{root}/{overlays.TRAIL}/{node(link)}"
        overlays.draw_trail(builder, path, size, positions[body], colours(sampled.values))
    for item, body in axes.items():
        overlays.draw_axes(builder, f"{root}/{item}", _AXIS * size, 0.5 * size)
        moved[f"{root}/{item}"] = body
    for path, body in moved.items():
        builder.move(path, times, positions[body], quaternions[body])
    if setting.model.on_table:
        boxes = [bounding_box(shape) for shape in sampled.visuals.shapes if shape.body == 0]
        overlays.draw_table(builder, root, sampled.carried(0, np.vstack(boxes)))
    if areas is not None:
        overlays.draw_areas(builder, root, motion, areas)
        path = f"{root}/{overlays.AREAS}/{areas.point}"
        builder.mesh(path, g.Sphere(2.0 * size), _POINT_COLOUR)
        points = positions[-1] + sampled.rotations[:, -1] @ areas.offset
        builder.move(path, times, points, quaternions[-1])
    model, joints = setting.model, sampled.joints.T.round(5).tolist()
    trail = Trail(
        (builder.start + times).round(6).tolist(),
        [float(f"{value:.6g}") for value in sampled.values],
        sampled.fractions.round(6).tolist() if motion.law.follows_path else None,
        6 * overlays.SIDES,
        list(zip(model.joint_names, model.prismatic.tolist(), joints, strict=True)),
    )
    contact, event, margin = deepest_contact(motion), singular_event(motion), setting.margin
    if contact is not None:
        contact = replace(contact, time=place.start + contact.time)
    kept = not margin.threshold or margin.keeps(closest_approach(motion, margin.measure).value)
    return TitledScene(
        title, node(title), labels, begin=builder.start + float(times[0]),
        end=builder.start + float(times[-1]), origin=np.asarray(place.origin).round(6).tolist(),
        margin=margin.threshold, keeps_margin=bool(kept), ending=motion.ending.name.lower(),
        verdict=motion.outcome if event is None else f"{motion.outcome} Kind: {event.kind}.",
        trail=trail,
        lines=tuple(filter(None, (violation, "" if contact is None else f"warning: {contact}"))),
    )  # fmt: skip


def _view(samples: Sequence[SampledMotion], places: Sequence[Place], planar: bool) -> View:
    """The page's first view, which covers the motions and, in the plane, the reach."""
    parts = [np.zeros((1, 3))]
    for sampled, place in zip(samples, places, strict=True):
        parts += [np.asarray(place.origin) + points for points in _extent(sampled)]
        if planar and sampled.areas is not None:
            axes = sampled.motion.setting.plane.axes[:, :2].T
            parts += [sampled.areas.reach[1] * axes, -sampled.areas.reach[1] * axes]
    points = np.vstack(parts)
    points = points[scipy.spatial.ConvexHull(points, qhull_options="QJ").vertices]
    centre = (points.min(axis=0) + points.max(axis=0)) / 2.0
    surroundings = [place for sampled in samples for place in sampled.surroundings.places()]
    direction = view_direction([sampled.positions for sampled in samples], surroundings)
    plane = samples[0].motion.setting.plane if planar else None
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

    Corners further from their body's origin than the arm is long, as corners of solar panels,
    are left out.
    """
    setting = sampled.motion.setting
    chosen = np.unique(np.linspace(0, len(sampled.times) - 1, _INSTANTS).astype(int))
    length = np.linalg.norm(np.diff(sampled.positions[0], axis=0), axis=1).sum()
    parts = [*sampled.surroundings.extent(), *(cone.extent() for cone in sampled.cones)]
    for shape in sampled.visuals.shapes:
        corners = bounding_box(shape)
        near = corners[np.linalg.norm(corners, axis=1) <= length]
        parts.append(sampled.carried(shape.body, near, chosen))
    axes = _AXIS * overlays.thickness(setting) * np.eye(3)
    framed = (0, *range(len(setting.model.bodies), sampled.positions.shape[1]))
    return [*parts, *(sampled.carried(body, axes, chosen) for body in framed)]
