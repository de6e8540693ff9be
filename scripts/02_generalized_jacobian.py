"""The generalized Jacobian, and a singularity that a fixed base does not have.

``python scripts/02_generalized_jacobian.py`` ends in the elbow angle [degrees] at which the arm
becomes dynamically singular although it is bent.

S* gives the velocity of the end-effector per joint rate while the system's momentum stays zero. It
becomes singular in other configurations than the Jacobian of the same arm on a fixed base.
"""

import numpy as np
from scipy.optimize import brentq

import freefloat as ff

model = ff.FreeFloatingModel.from_urdf("planar_2dof")
task = ff.Task.PLANAR_POSITION  # two joints, two coordinates
bent = np.radians([30.0, 60.0])

# S* gives the end-effector's velocity per joint rate [m/rad] of the free-floating system.
S = ff.generalized_jacobian(model, bent, task)
print("S*:", np.round(S, 4), sep="\n")

# A spacecraft of a million times the mass is a fixed base.
fixed = ff.FreeFloatingModel.from_urdf("planar_2dof", scale_mass={"spacecraft": 1e6})
J = ff.generalized_jacobian(fixed, bent, task)
print("J:", np.round(J, 4), sep="\n")


def determinant(elbow: float) -> float:
    """Det S* [m²] with the shoulder at 60 degrees, for elbow angles [rad]."""
    return float(np.linalg.det(ff.generalized_jacobian(model, [np.radians(60.0), elbow], task)))


# J is singular with the arm straight (0 or 180 degrees) and nowhere else; S* in another place.
elbow = brentq(determinant, np.radians(1.0), np.radians(90.0))
J = ff.generalized_jacobian(fixed, [np.radians(60.0), elbow], task)
print(f"there det S* = {abs(determinant(elbow)):.0e} m², but det J = {np.linalg.det(J):.4f} m²")
print(f"dynamically singular at an elbow of {np.degrees(elbow):.4f} deg")
