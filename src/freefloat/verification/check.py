"""Verification of results: what they state is recomputed, or named as not verified."""

from __future__ import annotations

from collections.abc import Callable

from freefloat.errors import InputError
from freefloat.planning.answer import Answer
from freefloat.planning.goals.goal_motion import GoalMotion
from freefloat.planning.margin_map import MarginMap
from freefloat.planning.phases.manoeuvre import Manoeuvre
from freefloat.planning.plan import Plan
from freefloat.planning.plane.heading_map import HeadingMap
from freefloat.planning.simulation import Simulation
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.records import Known
from freefloat.singularities.singularity_map import SingularityMap
from freefloat.verification.engine_runs import require_engine
from freefloat.verification.goal_motions import goal_report
from freefloat.verification.manoeuvre import manoeuvre_report
from freefloat.verification.margin_maps import map_report
from freefloat.verification.path_motions import plan_report, simulation_report
from freefloat.verification.report import PINOCCHIO, CheckReport
from freefloat.verification.singularity_map import singularity_map_report

_REPORTS: dict[type, Callable[..., tuple[CheckReport, Known]]] = {
    Plan: plan_report,
    Simulation: simulation_report,
    GoalMotion: goal_report,
    Manoeuvre: manoeuvre_report,
    AttitudeMap: map_report,
    HeadingMap: map_report,
    SingularityMap: singularity_map_report,
}


def check(result: Answer | MarginMap | SingularityMap, engine: str = PINOCCHIO) -> CheckReport:
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
    if type(result) not in _REPORTS:
        problem = f"a {type(result).__name__} was given"
        accepted = "a Plan, a Simulation, another answer of planning or a map"
        raise InputError("result", problem, accepted)
    require_engine(engine)
    report, known = recomputed(result, engine)
    return report.comparing(result, known)


def recomputed(
    result: Answer | MarginMap | SingularityMap, engine: str = PINOCCHIO
) -> tuple[CheckReport, Known]:
    """A report without the comparison of stated numbers, and what is recomputed of these."""
    return _REPORTS[type(result)](result, engine)
