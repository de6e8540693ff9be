"""Print every number of Nanos and Papadopoulos that freefloat can compute, beside the computed one.

Run it with ``python scripts/reproduce_paper.py``. Exit code 1 when a number is off by more than its
tolerance, which is two units of the last printed digit unless a line says otherwise.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table

import freefloat as ff
from freefloat.report import plan_document
from freefloat.singularity import joint_space_extremes
from freefloat.spatial import unit_quaternion
from freefloat.virtual_manipulator import VirtualManipulator


@dataclass(frozen=True)
class Line:
    """A printed number beside the computed one."""

    what: str
    printed: float
    computed: float
    tolerance: float
    remark: str = ""

    @property
    def agrees(self) -> bool:
        return abs(self.computed - self.printed) <= self.tolerance


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
    touches = (
        ("FB", [-3.6512, 0.1762, 1.7885]),
        ("AF, first", [-0.6074, 2.9265, 0.9617]),
        ("AF, second", [-0.7348, 2.9014, 0.2833]),
    )
    for name, joints in touches:
        yield Line(f"Example 1: S at the touch point of {name}", 5.0, S.value(np.array(joints)),
                   0.01, "joints printed to 1e-4")  # fmt: skip
    F = problem.path.pose(69.73).position
    yield from lines("Example 1: F in m", [-0.5, 1.4583], F[:2], 2e-4)
    nonstop = ff.load_scenario("planar_3dof/parabola_nonstop").problem().path
    yield Line("Example 1: (18b) at F, from its time", 5 / 6, nonstop.timing.s(69.73), 2e-4)
    for heading, becomes in ((140.0, "singular"), (200.0, "completed")):
        simulation = ff.simulate(problem, _heading(heading), branch=0)
        reached = simulation.chosen.motion.completed
        yield Line(f"Example 1: {heading:g} deg completes", becomes == "completed", reached, 0.0)


def planar_ranges() -> Iterator[Line]:
    """Section V on Example 1: touch points, ranges segment by segment, ranges at A.

    The paper looks at motions with S > 0 alone. Its printed touch points have S of 5.006, 4.992 and
    4.996 instead of 5, so that they can be met to a few milliradians only.
    """
    document = plan_document(ff.plan(ff.load_scenario("planar_3dof/parabola").problem()))
    AF, FB = (
        sorted((t for t in segment["touch_points"] if t["level"] > 0), key=lambda t: t["tau"])
        for segment in document["segments"]
    )
    touches = (
        ("FB", FB[0], [-0.7463, -3.6512, 0.1762, 1.7885], 0.9495),
        ("AF, first", AF[0], [0.9158, -0.6074, 2.9265, 0.9617], 0.4895),
        ("AF, second", AF[1], [1.5922, -0.7348, 2.9014, 0.2833], 0.6413),
    )
    for name, touch, printed, tau in touches:
        found = np.array([touch["heading"], *touch["joints"]])
        near = np.array(printed) + np.angle(np.exp(1j * (found - printed)))
        yield from lines(f"Example 1: touch point of {name} in rad", printed, near, 6e-3)
        yield Line(f"Example 1: its dimensionless time, {name}", tau, touch["tau"], 6e-3)
    limits = (
        ("at B, tangent", 318.9, FB[0]["heading_at_end_deg"]),
        ("at B, end touch", 259.4, FB[1]["heading_at_end_deg"]),
        ("of FB moved to F", 298.7, FB[1]["heading_at_start_deg"]),
        ("of FB moved to F", 354.2, FB[0]["heading_at_start_deg"]),
        ("of AF at F", 335.3, AF[0]["heading_at_end_deg"]),
        ("of AF at F", 60.9, AF[1]["heading_at_end_deg"]),
    )
    for name, printed, computed in limits:
        yield Line(f"Example 1: limit {name} in deg", printed, computed, 0.2)
    joined = document["segments"][0]["joined_at_end_deg"][0]["ranges"]
    yield from lines("Example 1: range of both at F in deg", [60.9, 298.7], joined[0], 0.2)
    ranges = np.ravel(document["attitude_ranges_deg"][0]["ranges"])
    yield from lines("Example 1: ranges at A in deg", [0.0, 63.0, 161.0, 360.0], ranges, 2.0)


def _heading(degrees: float) -> list[float]:
    half = np.deg2rad(degrees) / 2.0
    return [0.0, 0.0, float(np.sin(half)), float(np.cos(half))]


def spatial() -> Iterator[Line]:
    """Table II and Example 2."""
    problem = ff.load_scenario("spatial_6dof/line").problem()
    joints = np.array([0.1, 2.0, 3.3076, -2.6104, 2.2981, 1.4288])
    attitude = unit_quaternion("touch", [0.4295, -0.147, 0.6898, -0.564])
    S = problem.margin.measure.value(joints)
    yield Line("Example 2: S at the touch point", -5.0, S, 0.01, "joints printed to 1e-4")
    time = 0.4225 * problem.path.duration
    wanted, found = problem.path.pose(time), problem.model.end_effector_pose(attitude, joints)
    yield from lines("Example 2: end-effector at the touch point in m", list(wanted.position),
                     found.position, 1e-3)  # fmt: skip
    (touching,) = [
        one for one in problem.branches(attitude, time)
        if np.abs((one.joints - joints + np.pi) % (2 * np.pi) - np.pi).max() < 0.01
    ]  # fmt: skip
    back = ff.integrate_motion(problem, attitude, touching.joints, start=time, end=0.0)
    printed = [0.46, 0.0935, 0.7352, -0.489]
    yield from lines("Example 2: initial attitude", printed, back.final.attitude, 5e-4)
    bad = ff.simulate(problem, [0.1, 0.5, 0.2, -0.8367])
    singular = [one.motion for one in bad.followed if not one.motion.completed]
    yield Line("Example 2: singular branches of the bad attitude", 4, len(singular), 0, "decoded")
    final = singular[0].final
    C = problem.model.end_effector_pose(final.attitude, final.joints).position
    yield from lines("Example 2: singular point C in m", [0.1214, 0.4686, 0.1943], C, 3e-3)


def main() -> int:
    table = Table(title="Printed and computed")
    for column in ("quantity", "printed", "computed", "difference", "tolerance", ""):
        table.add_column(column)
    found = [*planar(), *planar_ranges(), *spatial()]
    for line in found:
        table.add_row(
            line.what, f"{line.printed:.6g}", f"{line.computed:.6g}",
            f"{line.computed - line.printed:.1e}", f"{line.tolerance:.0e}",
            ("agrees" if line.agrees else "[bold red]OFF") + (line.remark and f", {line.remark}"),
        )  # fmt: skip
    Console(width=140).print(table)
    return 0 if all(line.agrees for line in found) else 1


if __name__ == "__main__":
    sys.exit(main())
