"""Phases of a manoeuvre after its first path."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.capture import Client
from freefloat.dynamics.redundancy import Redundancy
from freefloat.dynamics.summary import roll_pitch_yaw
from freefloat.errors import InputError, finite_number, finite_vector, require_type
from freefloat.motion.problem import Problem
from freefloat.paths.relative_path import RelativePath
from freefloat.paths.time_laws import positive_duration
from freefloat.paths.timing import TimedPath
from freefloat.paths.transfer import transfer
from freefloat.planning.phases.expected_state import ExpectedState, keys_within
from freefloat.planning.phases.prescribed_path import prescribed_path, require_continuous
from freefloat.robot.parts import Mount, inertia_matrix
from freefloat.scene.scene_body import SceneBody
from freefloat.scene.tumbling import Tumbling
from freefloat.so3 import Array, Pose, frozen

FRAMES = ("inertial", "spacecraft", "base", "end_effector")
"""Frames of poses that are reached: that of the manoeuvre, or those of links at the beginning."""
_FARTHEST = 1e3
"""Largest value of a joint at the end of a phase [rad or m]."""
_FIRST_NAMES = ("reorientation", "settling", "path")
"""Names of the phases up to the first path."""
_SAME = 1e-6
"""Relative difference of inertias, and difference of centres of mass [m], that are the same."""


@dataclass(frozen=True, eq=False)
class PoseGoal:
    """A pose that the end-effector moves to from where it is, and at which it rests.

    Attributes:
        pose: The pose.
        duration: [s].
        frame: ``"inertial"``, that of the manoeuvre; or, where the phase begins, ``"spacecraft"``,
            the root link, ``"base"``, the link that carries the first joint, or
            ``"end_effector"``.

    Example:
        >>> back = ff.so3.Pose([0.0, 0.0, -0.02], np.eye(3))
        >>> ff.PoseGoal(back, duration=15.0, frame="end_effector").frame
        'end_effector'
    """

    pose: Pose
    duration: float
    frame: str = "inertial"

    def __post_init__(self) -> None:
        require_type("goal.pose", self.pose, Pose, "a Pose")
        object.__setattr__(self, "duration", positive_duration("duration", self.duration))
        if self.frame not in FRAMES:
            raise InputError("frame", f"{self.frame!r} was given", ", ".join(FRAMES))


@dataclass(frozen=True, eq=False)
class PathPhase:
    """A further path of the end-effector, from the state at which the phase before ends.

    Attributes:
        path: In the frame of the manoeuvre, in that of a body of the scene, or to a pose. It begins
            with the pose and the twist of the end-effector at the end of the phase before.
        name: Its name; by default ``"to"`` for a pose, else ``"path"``, with a number where another
            phase has that name.
        margin: Required magnitude of the first path's measure.
        redundancy: Null-space motion of redundant arms.

    Example:
        >>> goal = ff.PoseGoal(ff.so3.Pose([0.0, 0.0, -0.02], np.eye(3)), 15.0, "end_effector")
        >>> ff.PathPhase(goal, "stop").name
        'stop'
    """

    path: TimedPath | RelativePath | PoseGoal = field(repr=False)
    name: str = ""
    margin: float = 0.0
    redundancy: Redundancy | None = None

    def __post_init__(self) -> None:
        accepted = "a TimedPath, a RelativePath or a PoseGoal"
        require_type("path", self.path, TimedPath | RelativePath | PoseGoal, accepted)
        require_type("name", self.name, str, "a name")
        finite_number("margin", self.margin, "a magnitude of at least zero", 0.0)
        accepted = "Redundancy, such as Redundancy(metric='energy')"
        require_type("redundancy", self.redundancy, Redundancy | None, accepted)

    @property
    def kind(self) -> str:
        """What is done."""
        return "to" if isinstance(self.path, PoseGoal) else "path"

    def expected_after(self, state: ExpectedState) -> ExpectedState:
        """What is known of the state at its end before anything is planned.

        Raises:
            InputError: If it cannot follow what is known of the state at its beginning.
        """
        given, drift = self.path, state.problem.path.drift
        if isinstance(given, PoseGoal):
            path, end = state.resting(given.duration), None
            if given.frame == "inertial":
                end = given.pose
                if state.pose is not None and state.twist is not None:
                    path = transfer(state.pose, state.twist, end, given.duration, drift)
            return state.after(path, self.redundancy, end, np.zeros(6))
        if isinstance(given, RelativePath):
            state.body(given.body.name, "path.frame")
        path = prescribed_path(given, state.bodies_now, np.zeros(3), drift)
        if state.pose is not None:
            require_continuous(path, state.pose, state.twist, state.problem.task)
        end, twist = path.path.pose(1.0), path.twist(path.duration) + path.drift_twist
        return state.after(path, self.redundancy, end, twist)


@dataclass(frozen=True, eq=False)
class JointPhase:
    """A motion of the joints from where they are to given values, at which they rest.

    Attributes:
        joints: Values at the end, by name or shape (n,) [rad or m].
        duration: [s].
        name: Its name; by default ``"joints"``, with a number where another phase has that name.

    Example:
        >>> ff.JointPhase({"q1": 0.2, "q2": -0.4}, duration=30.0, name="berth").duration
        30.0
    """

    joints: npt.ArrayLike | dict[str, float]
    duration: float
    name: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "duration", positive_duration("duration", self.duration))
        require_type("name", self.name, str, "a name")

    kind = "joints"

    def expected_after(self, state: ExpectedState) -> ExpectedState:
        """See :meth:`PathPhase.expected_after`."""
        model = state.problem.model
        for name, value, low, high in zip(
            model.joint_names, model.joint_vector(self.joints, "joints"), *model.joint_ranges,
            strict=True,
        ):  # fmt: skip
            low, high = max(low, -_FARTHEST), min(high, _FARTHEST)
            if not low <= value <= high:
                accepted = f"{low:g} to {high:g} rad or m"
                raise InputError("joints", f"{name} is {value:g}", accepted)
        return state.after(state.resting(self.duration))


@dataclass(frozen=True, eq=False)
class CapturePhase:
    """A body of the scene is fixed to the end-effector, and becomes a payload of the robot.

    Attributes:
        body: Name of the body.
        mass: [kg].
        inertia: About its centre of mass, axes of its frame [kg m²], in the forms of
            :class:`~freefloat.robot.parts.Spacecraft`; by default that of its tumbling.
        com: Centre of mass in its frame [m], shape (3,); by default that of its tumbling, or zero.
        name: Name of the phase; by default ``"capture"``, with a number where another has that.

    Example:
        >>> ff.CapturePhase("client", mass=150.0, inertia=[28.0, 25.0, 30.0]).mass
        150.0
    """

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

    kind = "capture"

    def expected_after(self, state: ExpectedState) -> ExpectedState:
        """See :meth:`PathPhase.expected_after`."""
        body = state.body(self.body, "body")
        tumbling = body.motion
        if isinstance(tumbling, Tumbling):
            self._require_consistent(tumbling)
        elif self.inertia is None:
            raise InputError(
                "inertia", "it is missing", "an inertia, or one in the body's tumbling"
            )
        return state.without(body)

    def _require_consistent(self, tumbling: Tumbling) -> None:
        """Raise an InputError unless inertia and centre of mass are those of the body's rotation.

        Else capture would change the momentum of a body that nothing touches.
        """
        if self.com is not None and np.abs(self.com - tumbling.com).max() > _SAME:
            problem = f"{self.com.tolist()} is not the point about which the body tumbles"
            raise InputError("com", problem, f"{tumbling.com.tolist()}, or none: it is the default")
        if self.inertia is not None:
            factor = np.trace(self.inertia) / np.trace(tumbling.inertia)
            if not np.allclose(self.inertia, factor * tumbling.inertia, _SAME, _SAME * factor):
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


Phase = PathPhase | JointPhase | CapturePhase


def checked_phases(
    problem: Problem, phases: Iterable[Phase], keys: Sequence[str] | None = None
) -> tuple[Phase, ...]:
    """The phases with distinct names, which can follow one another as far as is known beforehand.

    Args:
        problem: That of the first path.
        phases: The phases.
        keys: Of the phases, for errors; by default ``phases.0`` and so on.

    Raises:
        InputError: If one is no phase, or cannot follow the path and the phases before.
    """
    require_type("phases", phases, Iterable, "a list of phases")
    given = tuple(phases)
    keys = [f"phases.{k}" for k in range(len(given))] if keys is None else keys
    state, taken = ExpectedState.after_first(problem), {*_FIRST_NAMES}
    for number, (phase, key) in enumerate(zip(given, keys, strict=True)):
        accepted = "a PathPhase, a JointPhase or a CapturePhase"
        require_type(key, phase, PathPhase | JointPhase | CapturePhase, accepted)
        with keys_within(key):
            state = phase.expected_after(state)
        if phase.name in taken:
            twice = f"another phase is named {phase.name!r}"
            raise InputError(f"phases.{number}.name", twice, "another name")
        taken |= {phase.name} - {""}
    named = list[Phase]()
    for phase in given:
        numbered = (phase.kind, *(f"{phase.kind} {number}" for number in range(2, 3 + len(given))))
        name = phase.name or next(name for name in numbered if name not in taken)
        taken.add(name)
        named.append(replace(phase, name=name))
    return tuple(named)
