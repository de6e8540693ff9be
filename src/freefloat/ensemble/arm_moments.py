"""What further arms that move along joint curves add to the spacecraft, as the kernels read it.

Seen from the spacecraft, these arms change its first moment and inertia, and have a linear and an
angular momentum of their own; equation (4) knows nothing else of them.
"""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.further_arms import spacecraft_moments
from freefloat.dynamics.kernel_axes import KernelAxes
from freefloat.dynamics.kernels.robot import FurtherArms
from freefloat.dynamics.link_frames import LinkFrames, in_frame
from freefloat.motion.problem import Problem
from freefloat.so3 import Array

_CELLS, _ERROR = (64, 256, 1024), 1e-10
"""Numbers of cubics that approximate the moments over the duration, and their relative error."""
NODES = np.array([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0, 0.5])
"""Fractions of a cell: four nodes of a cubic, and a place where its error is known."""
_THROUGH_NODES = np.linalg.inv(np.vander(NODES[:4], increasing=True))
"""Maps values at the first four nodes to the cubic's coefficients, lowest power first."""


def kernel_arms(problem: Problem, frames: LinkFrames) -> FurtherArms:
    """Moments of the spacecraft with the further arms of a problem.

    Args:
        problem: Robot and joint curves.
        frames: Link frames of the robot whose further arms are fixed.
    """
    axes, origin = frames.base[:3], frames.base[3]
    for number in _CELLS:
        times = (np.arange(number)[:, None] + NODES) * (problem.path.duration / number)
        joints, rates = (problem.arms.at(times, order) for order in (0, 1))
        rows, momenta = spacecraft_moments(problem.model, joints, rates)
        momenta = KernelAxes.of(problem.model, problem.task).seen(momenta)
        rows = in_frame(rows, axes, -axes @ origin)
        values = np.concatenate([rows[..., 1:4], momenta, rows[..., 4:]], axis=-1)
        cubics, error = cubics_through(values)
        size = np.abs(values).max(axis=(0, 1)) + np.abs(values[..., 3:]).max()
        if (error.max(axis=0) <= _ERROR * size).all():
            break
    return FurtherArms(number, number / problem.path.duration, cubics)


def cubics_through(values: Array) -> tuple[Array, Array]:
    """Cubics through values at ``NODES`` of cells, shape (cells, 5, m).

    Returns:
        Coefficients, highest power first, shape (cells, m, 4), and errors at the last of the nodes,
        shape (cells, m).
    """
    cubics = np.einsum("pk,nki->nip", _THROUGH_NODES, values[:, :4])[..., ::-1]
    error = np.abs(values[:, 4] - cubics @ (0.5 ** np.arange(3, -1, -1)))
    return np.ascontiguousarray(cubics), error
