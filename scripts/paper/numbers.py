"""The numbers that the paper prints, each beside the one that freefloat computes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

import freefloat as ff
from freefloat.dynamics.joint_space import joint_space_extremes
from freefloat.dynamics.measures import SingularityMeasure
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.so3 import Array
from paper.examples import (
    H_EXCHANGED,
    H_PRINTED,
    INITIAL_ATTITUDE,
    PLANAR_TOUCH_JOINTS,
    TABLE_1,
    TOUCH_ATTITUDE,
    TOUCH_JOINTS,
    TOUCH_TAU,
    example_1,
    example_2,
    initial_attitude,
    limits,
    near,
    plan_of_example_1,
    points_c,
    rounding,
    same_side,
    touch_point_of_example_2,
)

DEG, RAD = "deg", "rad"


@dataclass(frozen=True, eq=False)
class Number:
    """A printed number, or several, beside the computed ones.

    Attributes:
        what: The quantity.
        unit: Its unit.
        printed: As the paper prints it, numbers separated by commas.
        computed: As many numbers.
        note: What a reader must know about the comparison.
        allowed: Largest deviation, in units of the last printed digit; zero for counts.
        digit: The last printed digit; from the text if not given.
    """

    what: str
    unit: str
    printed: str
    computed: Array
    note: str = ""
    allowed: float = 2.0
    digit: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "computed", np.atleast_1d(np.asarray(self.computed, dtype=float)))
        if self.digit == 0.0:
            decimals = max(len(text.partition(".")[2]) for text in self.printed.split(", "))
            object.__setattr__(self, "digit", 10.0**-decimals)

    @property
    def deviation(self) -> float:
        """The largest one of the components, with its sign."""
        printed = [float(text) for text in self.printed.split(", ")]
        differences = self.computed - printed
        return float(differences[np.argmax(np.abs(differences))])

    @property
    def agrees(self) -> bool:
        return abs(self.deviation) <= self.allowed * self.digit * (1.0 + 1e-9)

    @property
    def decimals(self) -> int:
        """Decimals with which computed numbers are shown: one more than the digit has."""
        return 0 if self.allowed == 0.0 else max(0, 1 - round(np.log10(self.digit)))

    @property
    def shown(self) -> str:
        """The computed numbers."""
        return ", ".join(f"{value + 0.0:.{self.decimals}f}" for value in self.computed)


def text(values: Array) -> str:
    """Printed numbers as text, with the digits of the paper."""
    return ", ".join(f"{value:.10g}" for value in values)


@cache
def all_numbers() -> dict[str, list[Number]]:
    """All comparisons, by section."""
    return {
        "Example 1: the arm and the path": [*arm_and_path()],
        "Example 1: touch points": [*planar_touch_points()],
        "Example 1: the ranges of Fig. 5": [*planar_ranges()],
        "Example 2: the path and point C": [*spatial_path()],
        "Example 2: the touch point and the initial attitude": [*spatial_touch_point()],
    }


def arm_and_path() -> Iterator[Number]:
    """Table I, Fig. 4, (18b) and (30)."""
    problem = example_1()
    model, S = problem.model, problem.margin.measure
    by_hand = ", ".join(f"{length:.6f}" for length in lengths_by_hand())
    yield Number("barycentric lengths a, b, c, d", "m", by_hand,
                 VirtualManipulator.of(model).lengths(),
                 "not printed: from Table I by hand")  # fmt: skip
    S_max = joint_space_extremes(model, S).largest
    yield Number("largest S", "m⁴ kg", "150", S_max, "printed: about 150", digit=10.0)
    yield Number("S0 = 5 of the largest S", "%", "3.3", 500.0 / S_max, "printed: about 3.3")
    yield Number("L, how many times point 3 enters a PDW", "", "2", crossed_areas(problem),
                 allowed=0.0)  # fmt: skip
    parts = ff.workspace_regions(problem).path
    at_F = next(inside for (low, high), inside in parts if low <= 5 / 6 <= high)
    yield Number("PDW areas that contain F'", "", "0", int(bool(at_F)), allowed=0.0)
    path = example_1("parabola_nonstop").path
    for name, t, printed in (("A", 0.0, "2.0, 0.0"), ("B", 100.0, "-1.0, 2.0")):
        yield Number(name, "m", printed, path.pose(t).position[:2])
    middle = brentq(lambda t: path.pose(t).position[0], 0.0, 100.0)
    yield Number("C", "m", "0.0, 1.0", path.pose(middle).position[:2])
    t1 = brentq(lambda t: path.timing.s(t) - 5 / 6, 0.0, 100.0)
    yield Number("F", "m", "-0.5, 1.4583", path.pose(t1).position[:2])
    yield Number("t1, from A to F", "s", "69.73", t1)


def lengths_by_hand() -> Array:
    """The barycentric lengths a, b, c and d of Table I [m]."""
    masses = np.cumsum(TABLE_1["m"])
    before = np.append(0.0, masses[:-1])
    lengths = TABLE_1["l"] * before + TABLE_1["r"] * masses
    return np.asarray(lengths / masses[-1])


def rounded(S: SingularityMeasure, joints: Array) -> str:
    return f"the joints' rounding alone: up to {rounding(S, joints):.3f}"


def planar_touch_points() -> Iterator[Number]:
    """Section V.A on Example 1: printed touch points, the computed ones, and S at the printed."""
    S = example_1().margin.measure
    AF, FB = limits(0), limits(1)
    points = (
        ("FB", FB[0], 1, "-0.7463, -3.6512, 0.1762, 1.7885", "0.9495"),
        ("AF, first", AF[0], 0, "0.9158, -0.6074, 2.9265, 0.9617", "0.4895"),
        ("AF, second", AF[1], 0, "1.5922, -0.7348, 2.9014, 0.2833", "0.6413"),
    )
    for name, limit, segment, printed, tau in points:
        joints = PLANAR_TOUCH_JOINTS[name]
        yield Number(f"S at the printed touch point of {name}", "m⁴ kg", "5", S(joints),
                     rounded(S, joints), digit=0.01)  # fmt: skip
        point, (start, end) = limit.touch_point, plan_of_example_1().segments[segment].span
        state = near([point.heading, *point.joints], [float(x) for x in printed.split(", ")])
        share = (point.time - start) / (end - start)
        yield distant(f"touch point of {name}: θ0, q1, q2, q3", RAD, printed, state)
        yield distant(f"touch point of {name}: τ", "", tau, share)


def distant(what: str, unit: str, printed: str, computed: ArrayLike) -> Number:
    """A part of a touch point, which may be off by many digits and then says so."""
    number = Number(what, unit, printed, np.asarray(computed), allowed=60.0)
    beyond = abs(number.deviation) > number.digit
    return replace(number, note="beyond the digit: finding 8" if beyond else "")


def planar_ranges() -> Iterator[Number]:
    """Fig. 5 on Example 1: the limits of the ranges of heading, segment by segment, with S > 0."""
    plan = plan_of_example_1()
    AF, FB = limits(0), limits(1)
    rows = (
        ("FB: limits at B", "259.4, 318.9", (FB[1].end_heading, FB[0].end_heading)),
        ("FB: moved back to F", "298.7, 354.2", (FB[1].start_heading, FB[0].start_heading)),
        ("AF: limits at F", "60.9, 335.3", (AF[1].end_heading, AF[0].end_heading)),
    )
    for what, printed, headings in rows:
        yield Number(what, DEG, printed, np.degrees(headings))
    joined = plan.segments[0].joined_at_end[0].ranges[0]
    yield Number("AF and FB: range at F", DEG, "60.9, 298.7", np.degrees([joined.low, joined.high]))
    (at_A,) = plan.ranges[0].ranges
    for printed, heading in (("161", at_A.low), ("63", at_A.high % (2.0 * np.pi))):
        yield Number("AF and FB, moved back to A", DEG, printed, np.degrees(heading),
                     "feasible: from 161 over 360 = 0 to 63")  # fmt: skip
    for degrees, becomes in ((140.0, 1), (200.0, 0)):
        motion = ff.simulate(example_1(), heading=np.radians(degrees), branch=0).chosen.motion
        yield Number(f"singular motions from {degrees:g} deg, S > 0", "", str(becomes),
                     int(not motion.completed), allowed=0.0)  # fmt: skip


def spatial_path() -> Iterator[Number]:
    """Example 2: its path, and where the second attitude leads."""
    problem = example_2()
    yield Number("z of B", "m", "0.33", problem.path.pose(100.0).position[2], "computed by (41)")
    yield Number("L, how many times point 3 enters a PDW", "", "1", crossed_areas(problem),
                 allowed=0.0)  # fmt: skip
    for moved, note, allowed in ((True, "B in the plane (41)", 2.0), (False, "B as printed", 40.0)):
        points = points_c(moved=moved)
        farthest = max(points, key=lambda C: np.abs(C - [0.1214, 0.4686, 0.1943]).max())
        yield Number("C, where the arm becomes singular", "m", "0.1214, 0.4686, 0.1943", farthest,
                     f"{note}; the farthest of {len(points)} branches", allowed)  # fmt: skip


def crossed_areas(problem: ff.Problem) -> int:
    """How many times point 3 is in a path-dependent area along the path."""
    return sum(bool(inside) for _, inside in ff.workspace_regions(problem).path)


def spatial_touch_point() -> Iterator[Number]:
    """Section VI on Example 2: from q1 and q2 to the touch point, and back to the start."""
    problem = example_2()
    S = problem.margin.measure
    yield Number("S at the printed touch point", "m⁴ kg", "-5", S(TOUCH_JOINTS),
                 f"the `in-plane factor`; {rounded(S, TOUCH_JOINTS)}", digit=0.01)  # fmt: skip
    for momentum, allowed in ((H_EXCHANGED, 2.0), (H_PRINTED, np.inf)):
        exchanged = momentum == H_EXCHANGED
        note = "h1, h2 exchanged" if exchanged else "h as printed: wrist and attitude differ"
        point = touch_point_of_example_2(momentum)
        joints = near(point.joints, TOUCH_JOINTS)
        yield Number("touch point: τ", "", str(TOUCH_TAU), point.time / 100.0, note)
        yield Number("touch point: q", RAD, text(TOUCH_JOINTS), joints, note, allowed)
        attitude = same_side(point.attitude, TOUCH_ATTITUDE)
        yield Number("touch point: attitude", "", text(TOUCH_ATTITUDE), attitude, note, allowed)
    yield Number("initial attitude", "", text(INITIAL_ATTITUDE), initial_attitude(H_PRINTED),
                 "back from the touch point with h1, h2 exchanged, by h as printed")  # fmt: skip
    branches = ff.simulate(problem, INITIAL_ATTITUDE).branches
    largest = min(branches, key=lambda branch: branch.minimum_margin).closest_approach
    yield Number("largest S of the motion from the printed attitude", "m⁴ kg", "-5",
                 largest.sign * largest.value, digit=0.1)  # fmt: skip
