"""What further arms that move along joint curves add to the spacecraft, as the kernels read it.

Seen from the spacecraft, these arms change its first moment and inertia, and have a linear and an
angular momentum of their own; equation (4) knows nothing else of them.
"""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.link_frames import LinkFrames, in_frame, inertial_row
from freefloat.ensemble.kernel_axes import KernelAxes
from freefloat.ensemble.kernels.records import Arms
from freefloat.motion.problem import Problem
from freefloat.robot.model import FreeFloatingModel
from freefloat.rotations import Rotation
from freefloat.so3 import Array

_CELLS, _ERROR = (64, 256, 1024), 1e-10
"""Numbers of cubics that approximate the moments over the duration, and their relative error."""
_NODES = np.array([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0, 0.5])
NO_ARMS = Arms(0, 0.0, np.zeros((0, 0, 0)))
"""Where no further arm moves."""
_THROUGH_NODES = np.linalg.inv(np.vander(_NODES[:4], increasing=True))
"""Maps values at the first four nodes to the cubic's coefficients, lowest power first."""


def kernel_arms(problem: Problem, frames: LinkFrames) -> Arms:
    """Moments of the spacecraft with the further arms of a problem.

    Args:
        problem: Robot and joint curves.
        frames: Link frames of the robot whose further arms are fixed.
    """
    axes, origin = frames.base[:3], frames.base[3]
    for number in _CELLS:
        times = (np.arange(number)[:, None] + _NODES) * (problem.path.duration / number)
        joints, rates = (problem.arms.at(times, order) for order in (0, 1))
        rows, momenta = spacecraft_moments(problem.model, joints, rates)
        momenta = KernelAxes.of(problem.model, problem.task).seen(momenta)
        rows = in_frame(rows, axes, -axes @ origin)
        values = np.concatenate([rows[..., 1:4], momenta, rows[..., 4:]], axis=-1)
        cubics = np.einsum("pk,nki->nip", _THROUGH_NODES, values[:, :4])[..., ::-1]
        error = np.abs(values[:, 4] - cubics @ (0.5 ** np.arange(3, -1, -1))).max(axis=0)
        if (
            error <= _ERROR * (np.abs(values).max(axis=(0, 1)) + np.abs(values[..., 3:]).max())
        ).all():
            break
    return Arms(number, number / problem.path.duration, np.ascontiguousarray(cubics))


def spacecraft_moments(
    model: FreeFloatingModel, joints: Array, rates: Array
) -> tuple[Array, Array]:
    """Moments of spacecraft and further arms about the origin of the spacecraft frame.

    Args:
        model: Robot.
        joints: Joint values of the further arms [rad or m], shape (..., dof - arm_dof).
        rates: Their rates, of the same shape.

    Returns:
        Mass, first moment and inertia as :func:`.inertial_row` returns them, shape (..., 10), and
        the angular momentum relative to the spacecraft [N m s], shape (..., 3).
    """
    root, shape = model.bodies[0], joints.shape[:-1]
    zeros, one = np.zeros((*shape, 3)), np.broadcast_to(np.eye(3), (*shape, 3, 3))
    rows = np.broadcast_to(inertial_row(root.mass, root.centre, root.inertia), (*shape, 10))
    momentum = zeros
    rotation, origin, spin, velocity = one, zeros, zeros, zeros
    for k, body in enumerate(model.bodies[1 + model.arm_dof :]):
        if body.parent == 0:
            rotation, origin, spin, velocity = one, zeros, zeros, zeros
        axis = rotation @ body.placement.rotation @ body.axis
        step = rotation @ body.placement.position
        rotation = rotation @ body.placement.rotation
        value, rate = joints[..., k, None], rates[..., k, None]
        if body.prismatic:
            step = step + value * axis
        origin, velocity = origin + step, velocity + np.cross(spin, step)
        if body.prismatic:
            velocity = velocity + rate * axis
        else:
            turns = Rotation.from_rotvec((value * body.axis).reshape(-1, 3)).as_matrix()
            rotation = rotation @ turns.reshape(*shape, 3, 3)
            spin = spin + rate * axis
        offset = (rotation @ body.centre[:, None])[..., 0]
        own = inertial_row(body.mass, body.centre, body.inertia)
        rows = rows + in_frame(own, rotation, origin)
        inertia = rotation @ body.inertia @ np.swapaxes(rotation, -1, -2)
        moving = body.mass * (velocity + np.cross(spin, offset))
        momentum = momentum + np.cross(origin + offset, moving)
        momentum = momentum + np.einsum("...ij,...j->...i", inertia, spin)
    return rows, momentum
