"""The page docs/paper.md, written from equations, numbers, figures and findings."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import freefloat as ff
from freefloat.planning.motions import SimulatedBranch
from paper.equations import EQUATIONS, link
from paper.examples import (
    INITIAL_ATTITUDE,
    example_1,
    example_2,
    limits,
    plan_of_example_1,
    spatial_motion,
)
from paper.findings import all_findings
from paper.numbers import Number, all_numbers

PAGE = Path(__file__).resolve().parents[2] / "docs" / "paper.md"
PICTURES = "pictures/paper"
"""Their folder, from the page."""

INTRODUCTION = """\
# The paper

K. Nanos and E. Papadopoulos, *Avoiding Dynamic Singularities in Cartesian Motions of Free-Floating
Manipulators*, IEEE Transactions on Aerospace and Electronic Systems 51(3), 2015. This page has what
the paper prints beside what freefloat computes: its [numbers](#the-numbers) and
[equations](#the-equations), and [what was found](#what-was-found) about it on the way.
`python scripts/reproduce_paper.py --page` writes the page, and a test computes it again.
"""

NUMBERS = """\
## The numbers

"Deviation" is the largest one of a row, computed less printed. "Digit" is the last digit that the
paper prints or, for rounded values such as 5, the one to which they are compared; counts must be
equal. Point 3 is the virtual last joint, in Example 2 the virtual wrist: barycentric vectors of
constant lengths a, b and c lead from the centre of mass to it, and d from it to the end-effector.
θ0 is the spacecraft's heading, h1 to h3 are the components of the momentum, AF and FB the segments
of Example 1, and τ is the time as a fraction of a segment. In Example 2, here and in Figs. 9 to 11,
B is moved along z into the plane (41), unless a row says otherwise; the bundled scenario has B as
printed (finding 1).
"""

FIGURES = {
    "fig_2a": "Figure 2a: singularity curves I and II, and beside them margin curves III and IV, "
    "of S = 5, and those of S = -5.",
    "fig_2b": "Figure 2b: PIW, PDW A (of curve I) and PDW B (of curve II) with the path A'-F'-B' "
    "of point 3, the virtual last joint, which enters a PDW at each E.",
    "fig_3": "Figure 3: motion 1, along AB, touches a margin curve at C inside its path (Case I), "
    "and motion 2, along AB cut off at the first E of Fig. 2b, at its end (Case II). On the "
    "distance curves R point 3 is as far from the centre of mass as at A, B and E.",
    "fig_4": "Figure 4b: on the robot, the barycentric vectors a to d lead from the centre of mass "
    "to the end-effector.",
    "fig_5": "Figure 5: what the steps of the paper's flowchart yield for Example 1: feasible "
    "headings at F by each segment, by both, and at A.",
    "fig_6": "Figure 6: from 140 degrees the arm becomes singular, at D.",
    "fig_7": "Figure 7: from 200 degrees the end-effector follows the whole path.",
    "fig_8a": "Figure 8a: spacecraft attitude and joint angles of that motion.",
    "fig_8b": "Figure 8b: their rates.",
    "fig_9": "Figure 9: in Example 2 the arm becomes singular on the way, at C.",
    "fig_10": "Figure 10: from the printed attitude the path is followed from A to B.",
    "fig_11a": "Figure 11a: position of the end-effector.",
    "fig_11b": "Figure 11b: joint angles of shoulder and elbow.",
    "fig_11c": "Figure 11c: joint angles of the wrist.",
    "fig_11d": "Figure 11d: spacecraft attitude, x-y-z Euler angles.",
    "fig_11e": "Figure 11e: rates of shoulder and elbow.",
    "fig_11f": "Figure 11f: rates of the wrist.",
    "fig_11g": "Figure 11g: angular velocity of the spacecraft in inertial axes.",
}
"""What each figure shows."""


def page() -> str:
    """The page's text."""
    parts = [INTRODUCTION, why_161(), commands(), NUMBERS]
    parts += [f"### {title}\n\n{table(rows)}" for title, rows in all_numbers().items()]
    parts += [figures(), equations(), findings()]
    return "\n".join(filter(None, parts))


def why_161() -> str:
    """Example 1 in words."""
    touch, end = (limit.touch_point.time for limit in (limits(0)[1], limits(1)[1]))
    (_, high), (low, _) = plan_of_example_1().ranges[0].degrees
    non_stop = plan_of_example_1("parabola_nonstop").ranges[0].degrees
    singular = motion_from(140.0).motion.final.time
    from_160, from_162 = (motion_from(h).closest_approach.value for h in (160.0, 162.0))
    return f"""\
## Why 161 degrees

A free-floating spacecraft turns when its arm moves. At a *dynamic singularity* the end-effector
cannot move in some direction, because the turn of the spacecraft undoes what the joints do. The
paper's S is zero there: for planar arms `det A`, the determinant of the equations for the rates
(5), which depends on the joint angles q1 and q2 alone. So singular configurations are curves in the
plane of q1 and q2 (Fig. 2a). Beside each, a *margin curve* S = 5 m⁴ kg keeps a distance from it; 5
is a thirtieth of the largest S.

Point 3 is the virtual last joint of the arm ([dynamics](concepts/dynamics.md)). The places that it
takes in the configurations of a singularity curve form a ring in the workspace: PDW A, near the
centre of mass, and PDW B, far from it (Fig. 2b). In this *path-dependent workspace* it depends on
the way there whether the arm is singular. In the rest of the reach, the *path-independent
workspace* (PIW), it never is.

In Example 1 a planar arm with three joints moves its end-effector from A to B and rests at F
between, with a momentum of 0.5 N m s. The way of point 3 leads through PDW A before F and into PDW
B at its end. The joint angles that reach a place depend on the heading of the spacecraft, so the
heading at A decides which curve the motion draws in the plane of q1 and q2. One of two arm branches
is considered, the one with S > 0.

- With a heading of 140 degrees at A, S becomes zero at {singular:.1f} s, in PDW A, and the motion
  ends.
- With 160 degrees S comes down to {from_160:.2f}, with 162 degrees only to {from_162:.2f}. With
  **{low:.2f} degrees** the motion just touches the margin curve, at {touch:.1f} s in PDW A, and S
  grows again (Case I of the paper; motion 1 in Fig. 3).
- With **{high:.2f} degrees** S comes down to 5 in PDW B, at {end:.0f} s, when the end-effector
  arrives at B (Case II), and with a greater heading further.

These are the limits: from 161 degrees over 360 = 0 to 63 degrees, the paper's numbers, S stays
above 5. freefloat first computes *touch points*, where S = 5 and, for Case I, dS/dt = 0, and then
integrates back to A ([more](concepts/touch-points.md)).

S, its curves and the PDWs are the same for any momentum, but the motions change: momentum adds
joint rates that do not depend on the end-effector's velocity. So the limits depend on the duration,
too, and on a rest: without the one at F, which the paper's text does not mention, they are
{non_stop[1][0]:.2f} and {non_stop[0][1]:.2f} degrees.
"""


def commands() -> str:
    """Commands that compute the motions of the figures, with their arm branches."""
    spatial = next(
        branch.index for branch in example_2().branches(INITIAL_ATTITUDE)
        if np.allclose(branch.joints, spatial_motion().initial.joints)
    )  # fmt: skip
    attitude = "0.46 0.0935 0.7352 -0.489"
    return f"""\
Example 1 is `planar_3dof/parabola`, Example 2 `spatial_6dof/line`. These commands compute them:

```sh
freefloat plan planar_3dof/parabola # Example 1: its ranges
freefloat simulate planar_3dof/parabola --heading 140 --branch 0 # Fig. 6
freefloat simulate planar_3dof/parabola --heading 200 --branch 0 # Figs. 7 and 8
freefloat simulate spatial_6dof/line --attitude 0.1 0.5 0.2 -0.8367 --branch {spatial} # Fig. 9
freefloat simulate spatial_6dof/line --attitude {attitude} --branch {spatial} # Figs. 10 and 11
```
"""


def motion_from(degrees: float) -> SimulatedBranch:
    """The motion of Example 1 with S > 0 from a heading."""
    return ff.simulate(example_1(), heading=np.radians(degrees), branch=0).chosen


def table(rows: list[Number]) -> str:
    lines = ["| quantity | printed | computed | deviation | digit | |", "|---|---|---|---|---|---|"]
    return "\n".join([*lines, *map(row, rows), ""])


def row(number: Number) -> str:
    """A line of the table of numbers."""
    what = f"{number.what} [{number.unit}]" if number.unit else number.what
    deviation = f"{number.deviation:.1e}" if number.deviation else "0"
    digit = f"{number.digit:g}" if number.allowed else "exact"
    cells = (what, number.printed, number.shown, deviation, digit, number.note)
    return f"| {' | '.join(cells)} |"


def figures() -> str:
    """Those that are drawn, each below a sentence on it; empty if none is."""
    drawn = [
        f"{sentence}\n\n![{sentence}]({PICTURES}/{name}.png)\n"
        for name, sentence in FIGURES.items()
        if (PAGE.parent / PICTURES / f"{name}.png").exists()
    ]
    return "\n".join(["## The figures\n", *drawn]) if drawn else ""


def equations() -> str:
    lines = [
        "## The equations",
        "",
        "Modules are named below `freefloat`.",
        "",
        "| equation | function | |",
        "|---|---|---|",
    ]
    for equation in EQUATIONS:
        names = ", ".join(link(function, "../") for function in equation.functions)
        marks = ", ".join(f"({number})" for number in equation.numbers.split(", "))
        lines.append(f"| {marks} | {names or 'none'} | {equation.what} |")
    return "\n".join([*lines, ""])


def findings() -> str:
    lines = ["## What was found", ""]
    lines += [f"{i}. **{each.claim}** {each.seen}" for i, each in enumerate(all_findings(), 1)]
    return "\n".join([*lines, ""])
