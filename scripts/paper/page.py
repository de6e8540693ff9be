"""The page docs/paper.md, written from equations, numbers, figures and findings."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import freefloat as ff
from freefloat.planning.simulated_branch import SimulatedBranch
from paper.equations import EQUATIONS, link
from paper.examples import example_1, limits, plan_of_example_1
from paper.figures import DESCRIPTIONS
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

COMMANDS = """\
Example 1 is `planar_3dof/parabola`, Example 2 `spatial_6dof/line`. These commands compute them:

```sh
freefloat plan planar_3dof/parabola # Example 1: its ranges
freefloat simulate planar_3dof/parabola --heading 140 # Fig. 6
freefloat simulate planar_3dof/parabola --heading 200 # Figs. 7 and 8
freefloat simulate spatial_6dof/line --attitude 0.1 0.5 0.2 -0.8367 # Fig. 9
freefloat simulate spatial_6dof/line --attitude 0.46 0.0935 0.7352 -0.489 # Figs. 10 and 11
```
"""

NUMBERS = """\
## The numbers

"Deviation" is the largest one of a row, computed less printed. "Digit" is one unit of the last
digit that the paper prints; counts must be equal. The PDW is the path-dependent workspace: where
the arm can be singular. Point 3 is where the last link, or the wrist, begins in the virtual
manipulator. AF and FB are the two segments of Example 1, τ is the time as a fraction of a segment.
"""


def page() -> str:
    """The page's text."""
    parts = [INTRODUCTION, why_161(), COMMANDS, NUMBERS]
    parts += [f"### {title}\n\n{table(rows)}" for title, rows in all_numbers().items()]
    parts += [figures(), equations(), findings()]
    return "\n".join(filter(None, parts))


def why_161() -> str:
    """Example 1 in words."""
    touch = limits(0)[1].touch_point.time
    low = plan_of_example_1().ranges[0].degrees[-1][0]
    end = motion_from(140.0).motion.final.time
    from_160, from_162 = (motion_from(h).closest_approach.value for h in (160.0, 162.0))
    return f"""\
## Why 161 degrees

A free-floating spacecraft turns when its arm moves. At a *dynamic singularity* the end-effector
cannot move in some direction, because the turn of the spacecraft undoes what the joints do. A
number S, which depends on the joints alone, is zero there. The *margin curve* S = 5 keeps a
distance from it.

In Example 1 a planar arm with three joints moves its end-effector from A over F to B. The heading
of the spacecraft at A decides which joint values occur on the way. From 140 degrees S becomes zero
at {end:.1f} s, and the motion ends. From 160 degrees S comes down to {from_160:.2f}, from 162
degrees only to {from_162:.2f}. From {low:.2f} degrees the motion just touches the margin curve,
at {touch:.1f} s, and S grows again: there is the limit. freefloat first computes this *touch
point*, where S = 5 and dS/dt = 0, and then integrates back to A
([more](concepts/touch-points.md)).
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
        for name, sentence in DESCRIPTIONS.items()
        if (PAGE.parent / PICTURES / f"{name}.png").exists()
    ]
    return "\n".join(["## The figures\n", *drawn]) if drawn else ""


def equations() -> str:
    lines = [
        "## The equations",
        "",
        "Names are those of modules below `freefloat`.",
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
