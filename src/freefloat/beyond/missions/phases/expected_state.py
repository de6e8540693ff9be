"""What is known of the states of a manoeuvre before anything is planned."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from freefloat.dynamics.redundancy import Redundancy
from freefloat.errors import InputError
from freefloat.motion.problem import Problem
from freefloat.motion.problem_parts import require_few_revolutions
from freefloat.paths.timed_path import TimedPath
from freefloat.scene.scene import Scene
from freefloat.scene.scene_body import SceneBody
from freefloat.so3 import Array, Pose

_STILL = np.zeros(3)


@dataclass(frozen=True, eq=False)
class ExpectedState:
    """What is known of the state between two phases.

    Attributes:
        problem: Problem of the first path; after a capture without momentum, which is not known
            then.
        bodies: Bodies of the scene that are free, at time zero.
        time: Time from the beginning of the first path [s].
        pose: Pose of the end-effector in the frame of the manoeuvre; None where it is not known.
        twist: Twist in that frame [m/s; rad/s], shape (6,); None where it is not known.
    """

    problem: Problem = field(repr=False)
    bodies: tuple[SceneBody, ...]
    time: float
    pose: Pose | None
    twist: Array | None

    @classmethod
    def after_first(cls, problem: Problem) -> ExpectedState:
        """The state at the end of the first path, whose problem is given.

        Raises:
            InputError: If further arms follow paths.
        """
        problem = problem.with_arms_resting(problem.path.duration)
        problem.model.require_one_arm("phases")
        path = problem.path
        pose, twist = path.path.pose(1.0), path.twist(path.duration) + path.drift_twist
        return cls(problem, problem.scene.bodies, path.duration, pose, twist)

    @property
    def bodies_now(self) -> tuple[SceneBody, ...]:
        """The free bodies at this time, in the frame of the manoeuvre."""
        return tuple(body.later(self.time, _STILL) for body in self.bodies)

    def body(self, name: str, key: str, others: Sequence[str] = ()) -> SceneBody:
        """The free body with a name, at time zero.

        Args:
            name: Its name.
            key: Key of the name, for errors.
            others: What else the key accepts.

        Raises:
            InputError: If it is not in the scene, or moves with the end-effector.
        """
        free = {body.name: body for body in self.bodies if body.motion != "target"}
        if name in free:
            return free[name]
        problem = f"there is no {name!r}"
        if name in self.problem.scene.names:
            problem = f"{name} moves with the end-effector already"
        accepted = ", ".join([*others, *free]) or "none, the scene has no free bodies"
        raise InputError(key, problem, accepted)

    def after(self, duration: float, pose: Pose | None, twist: Array | None) -> ExpectedState:
        """The state after a duration [s], at which the end-effector has a pose and a twist.

        Raises:
            InputError: If system or bodies would rotate too often.
        """
        time = self.time + duration
        Scene(self.bodies).require_applicable(self.problem.model, time)
        require_few_revolutions(self.problem.system, duration)
        return replace(self, time=time, pose=pose, twist=twist)

    def after_path(
        self, path: TimedPath, redundancy: Redundancy | None, pose: Pose | None, twist: Array
    ) -> ExpectedState:
        """The state after a path of the robot; raises as :class:`.Problem`, too."""
        self.problem.replace(path=path, redundancy=redundancy, scene=Scene())
        return self.after(path.duration, pose, twist)

    def without(self, body: SceneBody) -> ExpectedState:
        """The state after the capture of a body."""
        bodies = tuple(entry for entry in self.bodies if entry is not body)
        problem = self.problem.replace(momentum=_STILL, wheel_momentum=_STILL)
        return replace(self, problem=problem, bodies=bodies, twist=None)


@contextmanager
def keys_within(key: str) -> Iterator[None]:
    """Context in which the keys of errors are those below another key, unless they name a file."""
    try:
        yield
    except InputError as error:
        if error.source is not None:
            raise
        raise error.with_key(f"{key}.{error.key}") from None
