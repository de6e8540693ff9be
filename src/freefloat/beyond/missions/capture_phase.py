"""Phases in which the end-effector captures a body of the scene."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import chain, count
from typing import Any, ClassVar

import numpy as np

from freefloat.beyond.missions.capture import Capture, Client, capture
from freefloat.beyond.missions.manoeuvre import Phase
from freefloat.beyond.missions.state import ExpectedState, SystemState
from freefloat.dynamics.summary import roll_pitch_yaw
from freefloat.errors import InputError, finite_number, finite_vector, require_type
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult
from freefloat.motion.problem import Problem
from freefloat.motion.setting import Setting
from freefloat.robot.description import IDENTITY
from freefloat.robot.parts import Mount, inertia_matrix
from freefloat.scene.scene import Scene
from freefloat.scene.scene_body import SceneBody
from freefloat.scene.tumbling import Tumbling
from freefloat.so3 import Array, Pose, frozen

_PAYLOAD = "payload"
"""Name of the link that a captured body becomes, but for a number."""
_SAME_BODY = 1e-6
"""Relative difference of inertias, and difference of centres of mass [m], that are the same."""


@dataclass(frozen=True, eq=False)
class PlannedCapture(Capture):
    """A capture as a phase: nothing moves, and there is nothing that could fail."""

    motion: ClassVar[None] = None
    feasible: ClassVar[bool] = True
    reason: ClassVar[str] = ""
    limits: ClassVar[Limits | None] = None
    limit_results: ClassVar[tuple[LimitResult, ...]] = ()


@dataclass(frozen=True, eq=False)
class CapturePhase(Phase):
    """A body of the scene is fixed to the end-effector, and becomes a payload of the robot.

    Attributes:
        body: Name of the body.
        mass: Mass of the body [kg].
        inertia: Inertia about its centre of mass, axes of its frame [kg m²], in the forms of
            :class:`~freefloat.robot.parts.Spacecraft`; by default the inertia of its tumbling.
        com: Centre of mass in its frame [m], shape (3,); by default the tumbling's, or zero.
        name: Name of the phase; by default ``"capture"``, with a number where another has it.

    Example:
        >>> ff.CapturePhase("client", mass=150.0, inertia=[28.0, 25.0, 30.0]).mass
        150.0
    """

    kind: ClassVar[str] = "capture"

    body: str
    mass: float
    inertia: Array | None = field(default=None, repr=False)
    com: Array | None = None
    name: str = ""

    def __post_init__(self) -> None:
        require_type("body", self.body, str, "the name of a body of the scene")
        require_type("name", self.name, str, "a name")
        finite_number("mass", self.mass, "a mass above zero [kg]", np.finfo(float).tiny)
        if self.inertia is not None:
            object.__setattr__(self, "inertia", inertia_matrix("inertia", self.inertia))
        if self.com is not None:
            object.__setattr__(self, "com", frozen(finite_vector("com", self.com, 3)))

    def expected_after(self, state: ExpectedState) -> ExpectedState:
        """See :class:`~freefloat.beyond.missions.manoeuvre.Phase`."""
        body = state.body(self.body, "body")
        tumbling = body.motion
        if isinstance(tumbling, Tumbling):
            self._require_consistent(tumbling)
        elif self.inertia is None:
            raise InputError(
                "inertia", "it is missing", "an inertia, or one in the body's tumbling"
            )
        if state.problem.task.planar:
            self._require_in_plane(body, state.problem)
        return state.without(body)

    def _require_in_plane(self, body: SceneBody, problem: Problem) -> None:
        """Raise an InputError where a body would take a planar robot out of its plane.

        A table carries the moments of a body at any height.
        """
        plane = problem.plane
        client, R = self.client(body, IDENTITY), plane.axes.T @ body.orientation
        height = float(plane.normal @ body.position + (R @ client.com)[2])
        height *= not problem.model.on_table
        rate, inertia, axis = R @ client.angular_velocity, R @ client.inertia @ R.T, plane.axis
        product = np.abs(inertia[:2, 2]).max() / np.trace(inertia)
        for value, reason in (
            (height, f"its centre of mass is at {axis} = {height:.4g} m"),
            (np.abs(rate[:2]).max(), f"it turns about another axis than {axis}"),
            (product, f"{axis} is no principal axis of it"),
        ):
            if abs(value) > plane.tolerance:
                accepted = (
                    f"a body with its centre of mass at {axis} = 0 that turns about its principal "
                    f"axis {axis}"
                )
                raise InputError("body", f"{reason}, in a planar task", accepted)

    def _require_consistent(self, tumbling: Tumbling) -> None:
        """Raise an InputError unless inertia and centre of mass fit the body's rotation.

        Else capture would change the momentum of a body that nothing touches.
        """
        if self.com is not None and np.abs(self.com - tumbling.com).max() > _SAME_BODY:
            problem = f"{self.com.tolist()} is not the point about which the body tumbles"
            raise InputError("com", problem, f"{tumbling.com.tolist()}, or none: it is the default")
        if self.inertia is not None:
            factor = np.trace(self.inertia) / np.trace(tumbling.inertia)
            if not np.allclose(
                self.inertia, factor * tumbling.inertia, _SAME_BODY, _SAME_BODY * factor
            ):
                problem = "it is not proportional to that of the body's tumbling"
                moments = tumbling.inertia.tolist()
                raise InputError("inertia", problem, f"a multiple of {moments}, or none")

    def client(self, body: SceneBody, grapple: Pose) -> Client:
        """The body as a client, grasped at a pose in its frame."""
        inertia, com, rate = self.inertia, self.com, np.zeros(3)
        if isinstance(body.motion, Tumbling):
            inertia = body.motion.inertia if inertia is None else inertia
            com, rate = body.motion.com, body.motion.rate
        mount = Mount(grapple.position, roll_pitch_yaw(grapple.rotation))
        com = np.zeros(3) if com is None else com
        return Client(self.mass, inertia, mount, rate, com=com)  # type: ignore[arg-type]

    def _grasp(self, state: SystemState) -> tuple[SceneBody, Pose]:
        """The body, and the pose of the end-effector in its frame."""
        body = next(body for body in state.scene.bodies if body.name == self.body)
        return body, body.pose.inverse() @ state.pose

    def setting_at(self, state: SystemState) -> Setting:
        """The setting just after the capture: nothing moves during it."""
        return self.end(state, self.run(state, Limits())).problem

    def run(self, state: SystemState, limits: Limits) -> PlannedCapture:
        """The capture; its limits are the limits of the phases before and after it."""
        problem, now = state.problem, (state.attitude, state.joints)
        taken = {*problem.model.description.links_by_name, *problem.scene.names}
        names = chain([_PAYLOAD], (f"{_PAYLOAD}_{number}" for number in count(2)))
        name = next(name for name in names if name not in taken)
        client = replace(self.client(*self._grasp(state)), name=name)
        result = capture(problem.system, client, *now, state.joint_rates)
        if problem.task.planar:
            normal = problem.plane.normal  # where rounding alone leads out of the plane
            momentum = (result.momentum @ normal) * normal
            velocity = result.velocity - (result.velocity @ normal) * normal
            result = replace(result, momentum=frozen(momentum), velocity=frozen(velocity))
        return PlannedCapture(**vars(result))

    def to_dict(self) -> dict[str, Any]:
        """See :class:`~freefloat.beyond.missions.manoeuvre.Phase`."""
        values = {"inertia": self.inertia, "com": self.com}
        properties = {key: value.tolist() for key, value in values.items() if value is not None}
        return {"capture": {"body": self.body, "mass": float(self.mass), **properties}}

    def end(self, state: SystemState, result: Any) -> SystemState:
        """The state just after the capture: the body is held."""
        problem = state.problem
        body, grapple = self._grasp(state)
        before, links = problem.model.description.links_by_name, result.model.description.links
        payload = next(link.name for link in links if link.name not in before)
        held = replace(
            body, position=grapple.inverse().position, orientation=grapple.inverse().rotation,
            motion="target", payload=payload,
            touch_links=(*body.touch_links, problem.model.end_effector_link),
        )  # fmt: skip
        other_bodies = (b for b in problem.scene.bodies if b.name != self.body)
        corridor = problem.scene.corridor
        if corridor is not None and corridor.body == self.body:
            corridor = None  # the end-effector does not move in it any more
        following = replace(
            problem.with_system(result.system), scene=Scene((*other_bodies, held), corridor)
        )
        return replace(
            state, problem=following, joint_rates=result.joint_rates,
            centre=state.centre + result.centre_of_mass,
        )  # fmt: skip
