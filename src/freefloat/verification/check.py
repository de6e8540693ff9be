"""Verification of results: what they state is recomputed, or named as not verified."""

from __future__ import annotations

from typing import Any

from freefloat.kinds import kind_of, named
from freefloat.planning.answer import Answer
from freefloat.planning.margin_map import MarginMap
from freefloat.records import Known
from freefloat.verification.engine import PINOCCHIO, other_engine
from freefloat.verification.report import CheckReport


def check(result: Answer | MarginMap | Any, engine: str = PINOCCHIO) -> CheckReport:
    """Verify a plan, a manoeuvre, a simulation, a motion to a goal or a map.

    The motion, of a simulation the chosen one, is compared with the equations, the path and the
    robot, and integrated again by another integrator; motions of other arm branches with their path
    and momentum. Every other value of the record is compared with one that is recomputed, or named
    in ``not_verified`` of the report. A singularity map is also compared with det A of its robot at
    random configurations.

    Args:
        result: The record, computed or loaded from a file.
        engine: Everything is always recomputed with freefloat's own dynamics, on Pinocchio;
            ``"mujoco"`` repeats the motion with MuJoCo's kinematics and dynamics in addition.

    Raises:
        InputError: If this is no result, the engine is unknown, not installed, has no model of the
            robot or is given for a map.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> report = ff.check(ff.simulate(problem, [0.0, 0.0, 0.0, 1.0]))
        >>> report.passed
        True
    """
    kind_of(result, saved=True)
    other_engine(engine)
    report, known = recomputed(result, engine)
    return report.comparing(result, known)


def recomputed(
    result: Answer | MarginMap | Any, engine: str = PINOCCHIO
) -> tuple[CheckReport, Known]:
    """A report without the comparison of stated numbers, and what is recomputed of these."""
    report: tuple[CheckReport, Known] = named(kind_of(result, saved=True).report)(result, engine)
    return report
