"""Violated limits of shapes along joint paths, with their derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import NamedTuple, Protocol

import numpy as np

from freefloat.beyond.missions.goals.attitude_kernel import JointCourse
from freefloat.beyond.missions.goals.joint_paths import JointPaths
from freefloat.limits.kinds.end_effector import CorridorLimit, PointingLimits
from freefloat.limits.kinds.spacecraft import BaseTurnLimit
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult
from freefloat.motion.pointing import Keep, angle_of
from freefloat.motion.setting import Setting
from freefloat.rotations import Rotation
from freefloat.scene.scene_body import EndEffectorPoses
from freefloat.so3 import Array, IntArray, angle_between

_STEP = 1e-6
"""Step of the differences [rad, m]."""
_MARGIN = 2e-3
"""Margin of angles and deviations, for the instants between those that are looked at [rad, m]."""
_MOST = 64
"""Instants of a limit that count, the worst of the instants that are looked at."""
_SCALE = 0.02
"""Violation that counts as one [rad, m]."""
_WIDENED = PointingLimits.name, CorridorLimit.name, BaseTurnLimit.name
"""Limits whose margins grow."""


class GoalViolations(NamedTuple):
    """Violations at M places of a course."""

    edges: IntArray  # ends of intervals at which they occur, (M,)
    amounts: Array  # how large they are, over what counts as one, (M,)
    by_joints: Array  # derivatives by the joints, (M, n)
    by_turn: Array  # derivatives by turns of the spacecraft, its axes, (M, 3)
    by_duration: Array  # derivatives by the duration, (M,)

    def jacobian(self, paths: JointPaths, course: JointCourse) -> Array:
        """Derivatives by the unknowns, shape (M, unknowns)."""
        basis, by_duration = paths.edge_basis[self.edges], self.by_duration
        rows = np.einsum("mk,mj->mkj", basis, self.by_joints)
        moved = paths.edges[self.edges] @ paths.fixed[1]
        last = by_duration + (moved * self.by_joints).sum(axis=1)
        turned = np.einsum("mi,mix->mx", self.by_turn, course.turns[self.edges])
        return np.asarray(np.column_stack([rows.reshape(-1, paths.size - 1), last]) + turned)


class ShapeLimits(Protocol):
    """Limits that depend on places, not on rates."""

    def violations(self, paths: JointPaths, course: JointCourse) -> GoalViolations:
        """What a course violates."""
        ...

    def widen(self, violation: LimitResult) -> bool:
        """Demand more of what a precise motion violates; False where it is another limit."""
        ...


@dataclass(frozen=True, eq=False)
class StateLimits:
    """Cones of pointing axes, the corridor, and the spacecraft's turn; their margins grow."""

    setting: Setting  # robot, scene and drift
    limits: Limits
    attitude: Array  # of the spacecraft at the start, unit quaternion x, y, z, w
    margins: dict[str, float] = field(default_factory=lambda: dict.fromkeys(_WIDENED, _MARGIN))

    def widen(self, violation: LimitResult) -> bool:
        """See :class:`ShapeLimits`."""
        margin, lack = self.margins.get(violation.limit), abs(violation.worst - violation.allowed)
        if margin is not None:
            self.margins[violation.limit] = margin + max(2.0 * lack, margin)
        return margin is not None

    @cached_property
    def _excesses(self) -> tuple[tuple[str, Callable[[float, Array, Array], float]], ...]:
        """How far a state, with its time, is beyond each limit [rad, m], with names of limits."""
        setting, model = self.setting, self.setting.model
        origin = setting.origin

        def beyond_cone(number: int, t: float, attitude: Array, joints: Array) -> float:
            limit = self.limits.pointing[number]
            angle = float(angle_of(*limit.vectors(model, attitude, joints, origin(t))))
            return (angle - limit.angle) * (1.0 if limit.keep is Keep.INSIDE else -1.0)

        def beyond_corridor(t: float, attitude: Array, joints: Array) -> float:
            pose = model.end_effector_pose(attitude, joints)
            frame = setting.scene.corridor_pose(t, setting, EndEffectorPoses.on(pose))
            corridor = setting.scene.corridor
            offset = frame.rotation.T @ (pose.position - frame.position)
            return -np.inf if corridor is None else corridor.deviation(offset) - corridor.allowed

        def beyond_turn(t: float, attitude: Array, joints: Array) -> float:
            return float(angle_between(attitude, self.attitude)) - (self.limits.base_turn or np.pi)

        cones = (partial(beyond_cone, number) for number in range(len(self.limits.pointing)))
        corridors = [(CorridorLimit.name, beyond_corridor)] * (setting.scene.corridor is not None)
        turns = [(BaseTurnLimit.name, beyond_turn)] * (self.limits.base_turn is not None)
        return (*((PointingLimits.name, cone) for cone in cones), *corridors, *turns)

    def violations(self, paths: JointPaths, course: JointCourse) -> GoalViolations:
        """See :class:`ShapeLimits`."""
        rows, n = [], paths.joint_count
        attitudes = Rotation.from_matrix(course.attitudes)
        quaternions, times = attitudes.as_quat(), course.duration * paths.times
        for name, excess in self._excesses:
            margin = self.margins[name]
            states = zip(times[1:], quaternions[1:], course.joints[1:], strict=True)
            values = np.array([excess(*state) for state in states])
            worst = np.argsort(-values)[:_MOST]
            for edge in worst[values[worst] > -margin] + 1:
                state = times[edge], attitudes[edge], course.joints[edge]
                amount, *slopes = self._row(excess, *state, paths.times[edge])
                rows.append((edge, amount + margin / _SCALE, *slopes))
        table = np.array(rows).reshape(-1, n + 6)
        return GoalViolations(
            table[:, 0].astype(np.int64), table[:, 1], table[:, 2 : n + 2],
            table[:, n + 2 : n + 5], table[:, -1],
        )  # fmt: skip

    def _row(
        self, excess: Callable[[float, Array, Array], float], t: float, R: Rotation, q: Array,
        s: float,
    ) -> tuple[float, ...]:  # fmt: skip
        """The excess of a limit over its scale and its derivatives, by differences."""
        steps, n = _STEP * np.eye(len(q) + 4), len(q)
        here = excess(t, R.as_quat(), q)
        changed = [
            excess(t + step[-1] * s, (R * Rotation.from_rotvec(step[n:-1])).as_quat(), q + step[:n])
            for step in steps
        ]
        slopes = (np.array(changed) - here) / _STEP / _SCALE
        return (here / _SCALE, *slopes)
