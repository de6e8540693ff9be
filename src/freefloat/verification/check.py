"""Verification of results: everything that they state is recomputed."""

from __future__ import annotations

from freefloat.errors import InputError
from freefloat.planning.manoeuvre import Manoeuvre
from freefloat.planning.plan import Plan
from freefloat.planning.reorientation import Reorientation
from freefloat.planning.simulation import Simulation
from freefloat.verification.manoeuvre import manoeuvre_checks
from freefloat.verification.motion import completed, verify_motion
from freefloat.verification.reorientation import reorientation_checks
from freefloat.verification.report import ENGINES, MUJOCO, PINOCCHIO, CheckReport


def check(
    result: Plan | Simulation | Reorientation | Manoeuvre, engine: str = PINOCCHIO
) -> CheckReport:
    """Verify a plan, the chosen motion of a simulation, a reorientation or a manoeuvre.

    The motion is compared with the equations, the path and the robot, and integrated again by
    another integrator; the closest approach, the limits, the ranges of headings, the robust radius
    and the tolerances are recomputed.

    Args:
        result: The record, computed or loaded from a file.
        engine: Everything is always recomputed with freefloat's own dynamics, on Pinocchio;
            ``"mujoco"`` repeats the motion with MuJoCo's kinematics and dynamics in addition.

    Raises:
        InputError: If the result is a map, or the engine is unknown or not installed.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> report = ff.check(ff.simulate(problem, [0.0, 0.0, 0.0, 1.0]))
        >>> report.passed
        True
    """
    if not isinstance(result, Plan | Simulation | Reorientation | Manoeuvre):
        problem = f"a {type(result).__name__} was given"
        accepted = "a Plan, a Simulation, a Reorientation or a Manoeuvre"
        raise InputError("result", problem, accepted)
    if engine not in ENGINES:
        raise InputError("engine", f"{engine!r} was given", ", ".join(ENGINES))
    if engine == MUJOCO:
        from freefloat.verification.mujoco_model import engine_module

        engine_module()
    if isinstance(result, Reorientation):
        checks = reorientation_checks(result, mujoco=engine == MUJOCO)
        return CheckReport("reorientation", tuple(completed("motion", lambda: checks)))
    if isinstance(result, Manoeuvre):
        return CheckReport("manoeuvre", tuple(manoeuvre_checks(result, engine)))
    return verify_motion(result, engine)
