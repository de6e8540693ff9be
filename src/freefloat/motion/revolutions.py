"""How often a system rotates along a path, which decides how long its integration takes."""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.momentum import inertia_matrices
from freefloat.dynamics.system import System
from freefloat.errors import InputError
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array

MAX_REVOLUTIONS = 50
"""Most rotations of the system along a path: the time of an integration depends on them."""


def require_few_revolutions(system: System, duration: float) -> None:
    """Raise an InputError if a system rotates too often in a duration [s]."""
    inertia = mean_inertia(system.model)
    turns = float(revolutions(system.momentum, system.wheels, inertia, duration))
    if turns > MAX_REVOLUTIONS:
        raise InputError(
            "momentum",
            f"{system.momentum_bound:g} N m s rotates the system {turns:.3g} times in "
            f"{duration:g} s",
            f"momentum and duration of at most {MAX_REVOLUTIONS} revolutions",
        )


def mean_inertia(model: FreeFloatingModel) -> float:
    """Mean of the robot's principal moments of inertia at zero joints [kg m²]."""
    locked_inertia, _ = inertia_matrices(model, np.zeros(model.dof))
    return float(np.trace(locked_inertia)) / 3.0


def revolutions(
    momenta: Array, wheels: Array, inertia: Array | float, duration: Array | float
) -> Array:
    """How often systems rotate along a path, shape (...).

    Args:
        momenta: Angular momenta [N m s], shape (..., 3).
        wheels: Momenta stored in wheels [N m s], likewise.
        inertia: Mean moments of inertia [kg m²], shape (...).
        duration: Duration of the path [s], shape (...).
    """
    magnitudes = np.linalg.norm(momenta, axis=-1) + np.linalg.norm(wheels, axis=-1)
    return np.asarray(magnitudes / inertia * duration / (2.0 * np.pi))
