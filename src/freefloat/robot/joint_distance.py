"""How far apart two configurations of an arm are."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from freefloat.robot.model import FreeFloatingModel


def joint_distance(model: FreeFloatingModel, one: npt.ArrayLike, other: npt.ArrayLike) -> float:
    """The largest difference of joint values [rad, m], whole turns of turning joints not counted.

    Args:
        model: The robot.
        one: Joint values [rad, m], shape (n,).
        other: Joint values [rad, m], shape (n,).
    """
    gap = np.subtract(one, other)
    turning = [not body.prismatic for body in model.bodies[1:]]
    gap[turning] = (gap[turning] + np.pi) % (2.0 * np.pi) - np.pi
    return float(np.abs(gap).max())
