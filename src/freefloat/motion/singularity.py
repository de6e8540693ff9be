"""Singular ends of motions, and of what kind these singularities are."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from freefloat.dynamics.generalized_jacobian import system_matrix, system_matrix_derivative
from freefloat.dynamics.measures import unit_factors
from freefloat.dynamics.tasks import Task, base_rotations, prescribed_rows
from freefloat.motion.motion import Ending, Motion
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array

_BEYOND = 1e-3
"""Fraction of its reach that an arm at the boundary of its reach can move beyond, at most. Arms on
heavy spacecraft (ETS-VII, a UR5 on 200 kg, a Panda on 150 and 300 kg) end at 3e-6 to 7e-4; Example
2 becomes singular at 1e-2."""
_KINEMATIC_DISTANCE = 0.02
"""Distance of the joints from a kinematic singularity [rad; prismatic: fraction of the reach]."""
_FOLD = 0.1
"""Smallest derivative of the singular value along its null vector at a fold, as a fraction of its
gradient: 0.3 to 0.8 where elbows are straight or folded, below 0.01 where wrist axes align."""


class SingularityKind(StrEnum):
    """Kind of the singularity at which a motion ends."""

    BOUNDARY = "boundary of reach"
    KINEMATIC = "kinematic"
    DYNAMIC = "dynamic"

    @property
    def description(self) -> str:
        """The kind with a few words on what it means."""
        return f"{self} ({_MEANINGS[self]})"


_MEANINGS = {
    SingularityKind.BOUNDARY: "the arm is stretched or folded but for a thousandth of its reach",
    SingularityKind.KINEMATIC: "singular with a fixed base, too",
    SingularityKind.DYNAMIC: "not singular with a fixed base",
}


@dataclass(frozen=True, eq=False)
class SingularEvent:
    """The singularity at the end of a motion.

    Attributes:
        time: Time [s].
        s: Path parameter.
        end_effector: Position of the end-effector, inertial axes [m], shape (3,).
        joints: Joint values [rad or m], shape (n,).
        kind: See :func:`singularity_kind`.
    """

    time: float
    s: float
    end_effector: Array
    joints: Array
    kind: SingularityKind

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        values = vars(self) | {"kind": str(self.kind)}
        return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in values.items()}


def singular_event(motion: Motion) -> SingularEvent | None:
    """The singularity at which a motion ended; None where it did not end at one."""
    if motion.ending is not Ending.SINGULAR:
        return None
    final, problem = motion.final, motion.problem
    pose = problem.model.end_effector_pose(final.attitude, final.joints)
    kind = singularity_kind(problem.model, problem.task, final.joints)
    s = problem.path.timing.s(final.time)
    return SingularEvent(final.time, s, pose.position, final.joints, kind)


def singularity_kind(model: FreeFloatingModel, task: Task, joints: Array) -> SingularityKind:
    """The kind of a configuration at which S* (7) loses rank.

    The Jacobian of the virtual manipulator, the arm while the spacecraft keeps its attitude,
    decides: where it keeps its rank the singularity is dynamic. Where it nearly loses rank, too,
    the motions in its null space decide, to second order. If all of them move the end-effector to
    the same side, the arm is stretched or folded, and there is no configuration beyond. Otherwise,
    as where axes of a wrist align, there is.
    """
    m, k = len(prescribed_rows(model, task)), base_rotations(model, task)
    rows, columns = unit_factors(model, task)
    S = rows[:, None] * system_matrix(model, joints, task)[k:, k:] * columns
    left, values, right = np.linalg.svd(S)
    lost = rows * left[:, -1]
    change = [lost @ system_matrix_derivative(model, joints, e, task)[k:, k:]
              for e in np.eye(len(columns), model.dof)]  # fmt: skip
    second = columns[:, None] * np.array(change) * columns
    null = right[m - 1 :]
    slope = float(np.linalg.norm(second @ null[0]))
    form = np.linalg.eigvalsh(null @ (second + second.T) @ null.T / 2.0)
    curvature = float(np.abs(form).max())
    one_sided = form.min() * form.max() > -((_FOLD * curvature) ** 2)
    value = float(values[-1])
    if one_sided and curvature > _FOLD * slope:
        beyond = value**2 / (2.0 * curvature)
        return SingularityKind.BOUNDARY if beyond < _BEYOND else SingularityKind.DYNAMIC
    kinematic = value <= _KINEMATIC_DISTANCE * slope
    return SingularityKind.KINEMATIC if kinematic else SingularityKind.DYNAMIC
