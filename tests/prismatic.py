"""An end-effector on three prismatic joints: motions known in closed form.

It moves along the spacecraft's x axis, on the line through its centre of mass: nothing rotates, and
the centre of mass between spacecraft and end-effector stays where it is.
"""

import numpy as np

import freefloat as ff
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.orientation import FixedOrientation
from freefloat.paths.timing import TimeLaw
from tests.robots import inertial_text, joint_text, link_text

BUS, TOOL = 90.0, 10.0
"""Masses [kg]."""
LENGTH, DURATION = 0.9, 20.0
"""Length of the end-effector's path [m], and its duration [s]."""
RELATIVE = LENGTH * (BUS + TOOL) / BUS
"""Displacement of the prismatic joint [m]: the spacecraft recoils."""


def shape_text(geometry, xyz="0 0 0"):
    """A ``<collision>``."""
    return f'<collision><origin xyz="{xyz}"/><geometry>{geometry}</geometry></collision>'


def prismatic_robot(bus="", hand="", more="", limits=(-4.0, 4.0)):
    """URDF text; collision shapes of both bodies, and further links, may be added."""
    parts = [
        link_text("bus", inertial_text(BUS, 10.0 * np.eye(3)) + bus),
        joint_text("x", "P", "bus", "a", axis="1 0 0", limits=limits),
        link_text("a"),
        joint_text("y", "P", "a", "b", axis="0 1 0"),
        link_text("b"),
        joint_text("z", "P", "b", "hand"),
        link_text("hand", inertial_text(TOOL, np.eye(3)) + hand),
        more,
    ]
    return f'<robot name="prismatic">{"".join(parts)}</robot>'


def prismatic_problem(text, start=0.9, law=TimeLaw.QUINTIC, duration=DURATION):
    """A path of one length from a point on the x axis [m from the centre of mass]."""
    model = ff.FreeFloatingModel.from_urdf(text, "hand")
    curve = PolynomialCurve.line((start, 0.0, 0.0), (start + LENGTH, 0.0, 0.0))
    path = ff.EndEffectorPath(curve, FixedOrientation(np.eye(3)))
    margin = ff.Margin(ff.singularity_measure(model, ff.Task.POSITION, "gjm"), 0.0)
    return ff.Problem(
        model, ff.TimedPath(path, ff.Timing(duration, law)), ff.Task.POSITION, np.zeros(3), margin
    )


def prismatic_motion(text, start=0.9, law=TimeLaw.QUINTIC, duration=DURATION):
    """The motion of :func:`prismatic_problem`."""
    problem = prismatic_problem(text, start, law, duration)
    joints = [start * (BUS + TOOL) / BUS, 0.0, 0.0]
    return ff.integrate_motion(problem, [0.0, 0.0, 0.0, 1.0], joints)
