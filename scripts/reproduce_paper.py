"""Print every number of Nanos and Papadopoulos that freefloat can compute, beside the computed one.

Run it with ``python scripts/reproduce_paper.py``. Exit code 1 when a number is off by more than its
tolerance, which is two units of the last printed digit unless a line says otherwise; numbers with
an infinite one are there to be compared.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from contourpy import contour_generator
from numpy.typing import ArrayLike
from rich.console import Console
from rich.table import Table
from scipy.optimize import brentq

import freefloat as ff
from freefloat.dynamics.joint_space import joint_space_extremes
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.orientation import FixedOrientation
from freefloat.planning.touching.margin_lines import StatesOnPath
from freefloat.planning.touching.touch_point import TouchPoint
from freefloat.planning.touching.touch_points import boundary_attitude, touch_points
from freefloat.regions.workspace import merged, workspace_regions
from freefloat.so3 import axes_rotation, unit_quaternion


@dataclass(frozen=True)
class Line:
    """A printed number beside the computed one; of infinite tolerance where only to be compared."""

    what: str
    printed: float
    computed: float
    tolerance: float
    remark: str = ""

    @property
    def agrees(self) -> bool:
        return abs(self.computed - self.printed) <= self.tolerance

    @property
    def verdict(self) -> str:
        word = "agrees" if self.agrees else "[bold red]OFF"
        return (
            "compared" if np.isinf(self.tolerance) else word + (self.remark and f", {self.remark}")
        )


def lines(what: str, printed: list[float], computed: np.ndarray, tolerance: float) -> list[Line]:
    """One line for each component of a vector."""
    pairs = zip(printed, computed, strict=True)
    return [Line(f"{what}[{i}]", p, float(c), tolerance) for i, (p, c) in enumerate(pairs)]


def planar() -> Iterator[Line]:
    """Table I and Example 1."""
    problem = ff.load_scenario("planar_3dof/parabola").problem()
    model, S = problem.model, problem.margin.measure
    for letter, printed, length in zip(
        "abcd", (0.424628, 1.783439, 0.966030, 0.399575), VirtualManipulator.of(model).lengths,
        strict=True,
    ):  # fmt: skip
        yield Line(f"Fig. 4: barycentric length {letter} in m", printed, length, 1e-6, "decoded")
    S_max = joint_space_extremes(model, S).largest
    yield Line("Example 1: S_max", 150.0, S_max, 2.0, "printed: about 150")
    yield Line("Example 1: S0 in percent of S_max", 3.3, 500.0 / S_max, 0.2)
    areas = workspace_regions(problem).path
    yield Line("Example 1: PDW areas that point 3 crosses, L", 2, sum(pdw for _, pdw in areas), 0)
    F_in_area = next(pdw for (low, high), pdw in areas if low <= 5 / 6 <= high)
    yield Line("Example 1: point 3 is in a PDW area at F", False, F_in_area, 0)
    printed_points = (
        ("FB", [-3.6512, 0.1762, 1.7885]),
        ("AF, first", [-0.6074, 2.9265, 0.9617]),
        ("AF, second", [-0.7348, 2.9014, 0.2833]),
    )
    for name, joints in printed_points:
        yield Line(f"Example 1: S at the touch point of {name}", 5.0, S(np.array(joints)),
                   0.01, "joints printed to 1e-4")  # fmt: skip
    F = problem.path.pose(69.73).position
    yield from lines("Example 1: F in m", [-0.5, 1.4583], F[:2], 2e-4)
    nonstop = ff.load_scenario("planar_3dof/parabola_nonstop").problem().path
    yield Line("Example 1: (18b) at F, from its time", 5 / 6, nonstop.timing.s(69.73), 2e-4)
    t1 = brentq(lambda t: nonstop.timing.s(t) - 5 / 6, 0.0, 100.0)
    yield Line("Example 1: t1 in s", 69.73, t1, 0.02)
    for name, t, printed in (("A", 0.0, [2.0, 0.0]), ("B", 100.0, [-1.0, 2.0])):
        yield from lines(f"Example 1: {name} in m", printed, nonstop.pose(t).position[:2], 1e-12)
    for heading, becomes in ((140.0, "singular"), (200.0, "completed")):
        simulation = ff.simulate(problem, _heading(heading), branch=0)
        reached = simulation.chosen.motion.completed
        yield Line(f"Example 1: {heading:g} deg completes", becomes == "completed", reached, 0.0)


def planar_ranges() -> Iterator[Line]:
    """Section V on Example 1: touch points, ranges segment by segment, ranges at A.

    The paper looks at motions with S > 0 alone. At its printed touch points S is 5.006,
    4.992 and 4.996 instead of 5, so that they can be met to a few milliradians only.
    """
    plan = ff.plan(ff.load_scenario("planar_3dof/parabola").problem())
    AF, FB = (
        sorted(
            (x for x in segment.limits if x.touch_point.level > 0), key=lambda x: x.touch_point.time
        )
        for segment in plan.segments
    )
    A, F, B = plan.segments[0].span[0], plan.segments[1].span[0], plan.segments[1].span[1]
    points = (
        ("FB", FB[0], (F, B), [-0.7463, -3.6512, 0.1762, 1.7885], 0.9495),
        ("AF, first", AF[0], (A, F), [0.9158, -0.6074, 2.9265, 0.9617], 0.4895),
        ("AF, second", AF[1], (A, F), [1.5922, -0.7348, 2.9014, 0.2833], 0.6413),
    )
    for name, limit, (start, end), printed, tau in points:
        point = limit.touch_point
        computed = np.array([point.heading, *point.joints])
        near = np.array(printed) + np.angle(np.exp(1j * (computed - printed)))
        yield from lines(f"Example 1: touch point of {name} in rad", printed, near, 6e-3)
        computed_tau = (point.time - start) / (end - start)
        yield Line(f"Example 1: its dimensionless time, {name}", tau, computed_tau, 6e-3)
    limits = (
        ("at B, tangent", 318.9, FB[0].end_heading),
        ("at B, tangent at its end", 259.4, FB[1].end_heading),
        ("of FB moved to F", 298.7, FB[1].start_heading),
        ("of FB moved to F", 354.2, FB[0].start_heading),
        ("of AF at F", 335.3, AF[0].end_heading),
        ("of AF at F", 60.9, AF[1].end_heading),
    )
    for name, printed, heading in limits:
        yield Line(f"Example 1: limit {name} in deg", printed, np.degrees(heading), 0.2)
    joined = plan.segments[0].joined_at_end[0].ranges[0]
    at_F = np.degrees([joined.low, joined.high])
    yield from lines("Example 1: range of both at F in deg", [60.9, 298.7], at_F, 0.2)
    (at_A,) = plan.ranges[0].ranges  # printed as 0 to 63 and 161 to 360
    limits_at_A = np.degrees([at_A.low, at_A.high])
    yield from lines("Example 1: range at A in deg", [161.0, 360.0 + 63.0], limits_at_A, 2.0)


def _heading(degrees: float) -> list[float]:
    half = np.deg2rad(degrees) / 2.0
    return [0.0, 0.0, float(np.sin(half)), float(np.cos(half))]


def example_2() -> ff.Problem:
    """Example 2 with B in the plane (41), in which it is said to lie.

    With its printed z of 0.33 m it is not; with the z that (41) gives, the printed point C and the
    printed touch point lie on the path to all their digits.
    """
    problem = ff.load_scenario("spatial_6dof/line").problem()
    normal, offset = np.array([0.4683, 1.1683, -0.7]), 0.4683
    A, B = (problem.path.path.curve(s) for s in (0.0, 1.0))
    B = np.array([*B[:2], (offset - normal[:2] @ B[:2]) / normal[2]])
    axes = axes_rotation("attitude", ("x", normal), ("z", A - B))
    path = ff.EndEffectorPath(PolynomialCurve.line(A, B), FixedOrientation(axes))
    return with_momentum(problem, problem.momentum, ff.TimedPath(path, problem.path.timing))


def with_momentum(
    problem: ff.Problem, h: ArrayLike, path: ff.TimedPath | None = None
) -> ff.Problem:
    return ff.Problem(problem.model, path or problem.path, problem.task, h, problem.margin)


def spatial() -> Iterator[Line]:
    """Table II and Example 2: the second attitude, and the printed touch point as it stands."""
    problem = example_2()
    yield Line("Example 2: z of B in m", 0.33, problem.path.pose(100.0).position[2], 5e-3,
               "computed from (41)")  # fmt: skip
    yield Line("Example 2: PDW areas that point 3 crosses, L", 1, crossed_areas(problem), 0)
    S = problem.margin.measure(PRINTED_JOINTS)
    yield Line("Example 2: S at its touch point", -5.0, S, 0.01, "joints printed to 1e-4")
    printed = problem.path.pose(PRINTED_TAU * problem.path.duration).position
    attitude = unit_quaternion("attitude", PRINTED_ATTITUDE)
    at_joints = problem.model.end_effector_pose(attitude, PRINTED_JOINTS).position
    yield from lines(
        "Example 2: end-effector at its touch point in m", list(printed), at_joints, 2e-4
    )
    simulation = ff.simulate(problem, [0.1, 0.5, 0.2, -0.8367])
    singular = [branch.motion for branch in simulation.branches if not branch.motion.completed]
    yield Line(
        "Example 2: singular branches of the second attitude", 4, len(singular), 0, "decoded"
    )
    for motion in singular:
        final = motion.final
        C = problem.model.end_effector_pose(final.attitude, final.joints).position
        yield from lines("Example 2: singular point C in m", [0.1214, 0.4686, 0.1943], C, 2e-4)


def crossed_areas(problem: ff.Problem) -> int:
    """How many areas that singular curves of S(q2, q3) sweep the path of point 3 enters."""
    angles = np.linspace(-np.pi, np.pi, 121)
    S = [[problem.margin.measure(np.array([0, a, b, 0, 0, 0])) for b in angles] for a in angles]
    swept = []
    for curve in contour_generator(angles, angles, np.array(S)).lines(0.0):
        joints = np.zeros((len(curve), 6))
        joints[:, [2, 1]] = curve
        wrist = VirtualManipulator.of(problem.model).kinematics(joints)[2][3]
        radii = np.linalg.norm(wrist, axis=1)
        swept.append((float(radii.min()), float(radii.max())))
    path = np.linalg.norm(StatesOnPath(problem, 0.0, 0.0).point_3, axis=1)
    return sum(bool((path.min() < high) & (low < path.max())) for low, high in merged(swept))


PRINTED_JOINTS = np.array([0.1, 2.0, 3.3076, -2.6104, 2.2981, 1.4288])
PRINTED_ATTITUDE = [0.4295, -0.147, 0.6898, -0.564]
PRINTED_TAU = 0.4225


def spatial_touch_point() -> Iterator[Line]:
    """Section VI on Example 2: from q1 and q2 to the touch point and back to the start.

    dS/dt = 0 holds at the printed touch point if the first two components of the momentum are
    exchanged, and it is integrated backward with the momentum as printed.
    """
    problem = example_2()
    exchanged = nearest_touch_point(with_momentum(problem, [0.3, 0.5, 0.1]))
    yield from touch_point_lines("touch point, h = (0.3, 0.5, 0.1)", exchanged, 2e-4, "")
    as_printed = nearest_touch_point(problem)
    yield from touch_point_lines("touch point, h as printed", as_printed, np.inf, "")
    printed = [0.46, 0.0935, 0.7352, -0.489]
    back = ff.integrate_motion(
        problem, exchanged.attitude, exchanged.joints, start=exchanged.time, end=0.0
    )
    yield from lines("Example 2: initial attitude", printed, towards(printed, back.final.attitude),
                     2e-4)  # fmt: skip
    for remark, state, tolerance in (
        ("from there", back.final, 5e-2),
        (
            "from the touch point by h as printed",
            boundary_attitude(problem, as_printed),
            5e-4,
        ),
    ):
        motion = ff.integrate_motion(problem, state.attitude, state.joints)
        closest = ff.closest_approach(motion, problem.margin.measure)
        yield Line("Example 2: the path is completed", True, motion.completed, 0, remark)
        yield Line("Example 2: S_max", -5.0, closest.sign * closest.value, tolerance, remark)


def nearest_touch_point(problem: ff.Problem) -> TouchPoint:
    """The touch point at the printed q1 and q2 that comes nearest to the printed one."""
    points = touch_points(problem, *PRINTED_JOINTS[:2], level=-5.0)
    return min(points, key=lambda point: np.abs(nearby(point.joints) - PRINTED_JOINTS).max())


def nearby(joints: np.ndarray) -> np.ndarray:
    """The joints, less whole revolutions, nearest to the printed ones."""
    return PRINTED_JOINTS + np.angle(np.exp(1j * (joints - PRINTED_JOINTS)))


def towards(printed: list[float], quaternion: np.ndarray) -> np.ndarray:
    return quaternion * np.sign(quaternion @ printed)


def touch_point_lines(
    what: str, point: TouchPoint, tolerance: float, remark: str
) -> Iterator[Line]:
    """Time, elbow and shoulder do not depend on the momentum, wrist and attitude do."""
    yield Line(f"Example 2: {what}: tau", PRINTED_TAU, point.time / 100.0, 2e-4)
    for i, (printed, joint) in enumerate(zip(PRINTED_JOINTS, nearby(point.joints), strict=True)):
        allowed, note = (2e-4, "") if i < 3 else (tolerance, remark)
        yield Line(f"Example 2: {what}: q{i + 1} in rad", printed, joint, allowed, note)
    attitude = towards(PRINTED_ATTITUDE, point.attitude)
    for i, (printed, component) in enumerate(zip(PRINTED_ATTITUDE, attitude, strict=True)):
        yield Line(f"Example 2: {what}: attitude[{i}]", printed, component, tolerance, remark)


def main() -> int:
    table = Table(title="Printed and computed")
    for column in ("quantity", "printed", "computed", "difference", "tolerance", ""):
        table.add_column(column)
    rows = [*planar(), *planar_ranges(), *spatial(), *spatial_touch_point()]
    for line in rows:
        table.add_row(
            line.what, f"{line.printed:.6g}", f"{line.computed:.6g}",
            f"{line.computed - line.printed:.1e}", f"{line.tolerance:.0e}",
line.verdict,
        )  # fmt: skip
    Console(width=140).print(table)
    return 0 if all(line.agrees for line in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
