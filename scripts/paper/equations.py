"""Equations of the paper and the functions that compute them.

Every function is imported here, so that none can be named that does not exist.
"""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from freefloat.dynamics.generalized_jacobian import (
    generalized_determinant,
    generalized_jacobian,
    system_matrix,
)
from freefloat.dynamics.joint_space import end_effector_distance
from freefloat.dynamics.measures import plane_axes, singularity_measure
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.dynamics.resolved_rates import ResolvedRateSolver
from freefloat.dynamics.system import System
from freefloat.motion.extrema import closest_approach
from freefloat.motion.integration import ArcFlow, integrate_motion
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.directed_orientation import DirectedOrientation
from freefloat.paths.orientation import OrientationLaw
from freefloat.paths.timed_path import TimedPath
from freefloat.paths.timing import TimeLaw, Timing
from freefloat.planning.margin_lines import PathOfPoint3, StatesOnPath
from freefloat.planning.planar_touch_points import planar_touch_points
from freefloat.planning.plane.ranges import heading_ranges
from freefloat.planning.space.map_sampling import attitude_map
from freefloat.planning.touch_points import end_points, touch_points
from freefloat.regions.margin_curves import TwoAngleDeterminant, margin_curves
from freefloat.regions.planar_regions import (
    PlanarArm,
    elbow_arm,
    point_3,
    point_3_on_path,
    wrist_in_tool,
)
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import axes_rotation, unit_quaternion

SOURCE = Path(__file__).resolve().parents[2] / "src"


@dataclass(frozen=True)
class Equation:
    """One or several equations.

    Attributes:
        numbers: As the paper has them: ``8a, 8b``.
        functions: What computes them; none for steps of a proof.
        what: One clause: what it is, and what the code does with it.
    """

    numbers: str
    functions: tuple[Any, ...]
    what: str


EQUATIONS = tuple(Equation(*row) for row in (
    ("1", (inertia_matrices, System.body_momentum),
     "conservation of angular momentum: D and Dq; the right side"),
    ("2, 3a, 3b, 3c", (system_matrix,),
     "end-effector velocity: the lower rows are J11\\* and J12\\*"),
    ("4", (ResolvedRateSolver.rates,),
     "solved for the spacecraft's angular velocity and the joint rates"),
    ("5", (system_matrix,), "the matrix A"),
    ("6", (generalized_determinant, singularity_measure),
     "det S\\*, zero at dynamic singularities; also as measures, `det S*` and `det A`"),
    ("7", (generalized_jacobian,), "the generalized Jacobian S\\*"),
    ("8a, 8b", (ResolvedRateSolver.rates,), "the solution of (4), without inverse matrices"),
    ("8c", (ArcFlow,), "quaternion rates, integrated together with (8b)"),
    ("9a, 9b, 10", (),
     "steps of a proof: S depends continuously on time and attitude; no code needs them"),
    ("11, 12a, 12b", (closest_approach,),
     "time and value of the smallest S of a motion, inside the path and at its ends"),
    ("13a, 13b", (attitude_map,),
     "smallest magnitude of S of the motion from each initial attitude, in the plane each heading"),
    ("14, 15", (touch_points,), "touch points inside the path (Case I) and, by (15), at its ends"),
    ("16", (planar_touch_points, end_points, end_effector_distance),
     "touch points at the ends of the path, Case II; distance from the centre of mass"),
    ("17a, 17b, 17c", (FreeFloatingModel.end_effector_pose, PlanarArm.vectors),
     "position and orientation of the end-effector from barycentric vectors"),
    ("18a", (TimeLaw,), "definition: a polynomial of fifth degree"),
    ("18b, 19", (TimeLaw.polynomials, Timing.s), "the quintic, and s at a time"),
    ("20a, 20b", (point_3_on_path,), "point 3 on the path"),
    ("21a", (PlanarArm.determinant, TwoAngleDeterminant.__call__),
     "S in its first and in its second form"),
    ("21b", (margin_curves,), "singularity and margin curves, as points and intervals"),
    ("22a, 22b", (TwoAngleDeterminant.q2,), "their two solutions: curves I and III, II and IV"),
    ("23a, 23b", (PlanarArm.determinant_rate,),
     "the two slopes: both sides of dS/dt = 0, undivided"),
    ("24", (ResolvedRateSolver.rates, PlanarArm.rates),
     "rates of heading and joints; of links, from the velocity of point 3"),
    ("25", (TimedPath.twist,), "velocity on the path"),
    ("26, 27", (PlanarArm.determinant_rate, planar_touch_points),
     "equal slopes: solved as dS/dt = 0, which has no poles"),
    ("28", (point_3,), "its magnitude is the distance of point 3"),
    ("29a, 29b", (heading_ranges,), "ranges between limits: one motion decides for each"),
    ("30a, 30b", (PolynomialCurve,), "the parabola, x and y over s"),
    ("30c", (DirectedOrientation.follow,), "the third link normal to the path"),
    ("31a, 31b", (FreeFloatingModel.end_effector_pose,), "end-effector pose"),
    ("32", (unit_quaternion,), "unit length"),
    ("33a, 33b", (TimedPath.twist, OrientationLaw.rate), "end-effector velocity on the path"),
    ("34", (generalized_determinant,), "det S\\* of a spatial arm"),
    ("35, 36", (wrist_in_tool, PathOfPoint3.at),
     "point 3 under a spherical wrist, on the path"),
    ("37, 39", (plane_axes,),
     "axes in which the system without the wrist splits into an in-plane block and the rest"),
    ("38", (StatesOnPath.slopes,), "dS/dt along a motion, zero at touch points"),
    ("40", (singularity_measure, elbow_arm),
     "S(q2, q3): the measure `in-plane factor`; the planar arm that has this S, for margin curves"),
    ("41", (axes_rotation,), "data of Example 2: end-effector axes from the plane's normal"),
    ("42, 43a, 43b", (ResolvedRateSolver.rates,), "(8) as one equation; A1, A2 are not formed"),
    ("43c", (ArcFlow,), "the matrix of (8c)"),
    ("44, 45, 46, 47", (integrate_motion,),
     "reversed motion: `end` before `start` leads back to where it began"),
    ("48, 49, 50", (TwoAngleDeterminant.k,),
     "k0, k1 and k2, also where centres of mass are beside the lines between joints"),
    ("51, 52, 53, 54", (),
     "steps of a proof: the number of limits is even; no code needs it, see (29a)"),
))  # fmt: skip


def link(function: Any, root: str) -> str:
    """A function's name within freefloat, linked to its file.

    Args:
        function: Function, method, property or class.
        root: Relative path from the page to the repository, such as ``../``.
    """
    if isinstance(function, property):
        function = function.fget
    file = Path(inspect.getsourcefile(function) or "").relative_to(SOURCE.parent)
    name = function.__qualname__.removesuffix(".__call__")
    module = function.__module__.removeprefix("freefloat.")
    return f"[`{module}.{name}`]({root}{file.as_posix()})"
