"""Free-floating space manipulators: from which attitudes a path avoids dynamic singularities.

From a URDF to a plan, and to MeshCat::

    import freefloat as ff
    import numpy as np

    task = ff.Task.POSE
    model = ff.FreeFloatingModel.from_urdf("robot.urdf", "end_effector")
    curve = ff.PolynomialCurve.line([1, 0, 0], [-0.5, 0.8, 0.33])  # from the centre of mass [m]
    path = ff.EndEffectorPath(curve, ff.FixedOrientation(np.eye(3)))
    timed = ff.TimedPath(path, ff.Timing(duration=100))  # [s]
    margin = ff.Margin(ff.singularity_measure(model, task, "gjm"), 0.02)
    problem = ff.Problem(model, timed, task, np.array([0.5, 0.3, 0.1]), margin)  # [N m s]
    plan = ff.plan(problem, ff.Search(samples=1024))
    print(plan.reason, plan.chosen.motion.initial.attitude)
    ff.show(plan)  # in a browser, or the notebook's cell

The same from a scenario file: ``problem = ff.load_scenario("spatial_6dof/line").problem()``.
Quaternions are x, y, z, w, units SI and radians; what cannot be used raises :class:`InputError`,
which tells the key, what is wrong with it and what is accepted. Arrays of results are read-only.
Names are loaded when first used, so that ``import freefloat`` costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from freefloat.dynamics.measures import singularity_measure as singularity_measure
    from freefloat.dynamics.momentum import Task as Task
    from freefloat.dynamics.momentum import generalized_jacobian as generalized_jacobian
    from freefloat.dynamics.redundancy import Redundancy as Redundancy
    from freefloat.ensemble.feasibility import FeasibilityEvaluator as FeasibilityEvaluator
    from freefloat.errors import FreeFloatError as FreeFloatError
    from freefloat.errors import InputError as InputError
    from freefloat.io.results import load as load
    from freefloat.io.results import save as save
    from freefloat.io.scenario import Scenario as Scenario
    from freefloat.io.scenario import load_scenario as load_scenario
    from freefloat.limits.check import check_limits as check_limits
    from freefloat.limits.limits import LimitResult as LimitResult
    from freefloat.limits.limits import Limits as Limits
    from freefloat.motion.closest_approach import ClosestApproach as ClosestApproach
    from freefloat.motion.closest_approach import closest_approach as closest_approach
    from freefloat.motion.integration import integrate_motion as integrate_motion
    from freefloat.motion.motion import Ending as Ending
    from freefloat.motion.motion import Motion as Motion
    from freefloat.motion.problem import Margin as Margin
    from freefloat.motion.problem import Problem as Problem
    from freefloat.motion.simulation import Simulation as Simulation
    from freefloat.motion.simulation import simulate as simulate
    from freefloat.motion.time_series import TimeSeries as TimeSeries
    from freefloat.paths.curves import ArcCurve as ArcCurve
    from freefloat.paths.curves import PolynomialCurve as PolynomialCurve
    from freefloat.paths.curves import SplineCurve as SplineCurve
    from freefloat.paths.orientation import DirectedOrientation as DirectedOrientation
    from freefloat.paths.orientation import FixedOrientation as FixedOrientation
    from freefloat.paths.orientation import SlerpOrientation as SlerpOrientation
    from freefloat.paths.path import EndEffectorPath as EndEffectorPath
    from freefloat.paths.timing import Stop as Stop
    from freefloat.paths.timing import TimedPath as TimedPath
    from freefloat.paths.timing import TimeLaw as TimeLaw
    from freefloat.paths.timing import Timing as Timing
    from freefloat.planning.attitude_map import AttitudeMap as AttitudeMap
    from freefloat.planning.heading_map import HeadingMap as HeadingMap
    from freefloat.planning.mapping import attitude_map as attitude_map
    from freefloat.planning.options import Objective as Objective
    from freefloat.planning.options import Search as Search
    from freefloat.planning.plan import Plan as Plan
    from freefloat.planning.planner import plan as plan
    from freefloat.robot.model import FreeFloatingModel as FreeFloatingModel
    from freefloat.robot.parts import Attachment as Attachment
    from freefloat.robot.parts import Mount as Mount
    from freefloat.robot.parts import Payload as Payload
    from freefloat.robot.parts import Spacecraft as Spacecraft
    from freefloat.studies.runner import run_study as run_study
    from freefloat.studies.study import Study as Study
    from freefloat.studies.study import load_study as load_study
    from freefloat.verification.check import CheckReport as CheckReport
    from freefloat.verification.check import check as check
    from freefloat.visualization.figures import figures as figures
    from freefloat.visualization.playback import Playback as Playback
    from freefloat.visualization.playback import playback as playback
    from freefloat.visualization.playback import show as show
    from freefloat.workspace.margin_curves import Workspace as Workspace
    from freefloat.workspace.regions import workspace as workspace

_ROOMS = {
    # the machine
    "FreeFloatingModel": "robot.model",
    "Mount": "robot.parts",
    "Spacecraft": "robot.parts",
    "Payload": "robot.parts",
    "Attachment": "robot.parts",
    "Task": "dynamics.momentum",
    "generalized_jacobian": "dynamics.momentum",
    "singularity_measure": "dynamics.measures",
    "Redundancy": "dynamics.redundancy",
    # the wish
    "PolynomialCurve": "paths.curves",
    "ArcCurve": "paths.curves",
    "SplineCurve": "paths.curves",
    "FixedOrientation": "paths.orientation",
    "SlerpOrientation": "paths.orientation",
    "DirectedOrientation": "paths.orientation",
    "EndEffectorPath": "paths.path",
    "Timing": "paths.timing",
    "TimeLaw": "paths.timing",
    "Stop": "paths.timing",
    "TimedPath": "paths.timing",
    "Margin": "motion.problem",
    "Problem": "motion.problem",
    # or both from a file
    "load_scenario": "io.scenario",
    "Scenario": "io.scenario",
    # one motion
    "simulate": "motion.simulation",
    "Simulation": "motion.simulation",
    "integrate_motion": "motion.integration",
    "Motion": "motion.motion",
    "Ending": "motion.motion",
    "closest_approach": "motion.closest_approach",
    "ClosestApproach": "motion.closest_approach",
    "TimeSeries": "motion.time_series",
    # its limits
    "Limits": "limits.limits",
    "LimitResult": "limits.limits",
    "check_limits": "limits.check",
    # a plan
    "plan": "planning.planner",
    "Plan": "planning.plan",
    "Search": "planning.options",
    "Objective": "planning.options",
    # a map
    "FeasibilityEvaluator": "ensemble.feasibility",
    "attitude_map": "planning.mapping",
    "AttitudeMap": "planning.attitude_map",
    "HeadingMap": "planning.heading_map",
    "workspace": "workspace.regions",
    "Workspace": "workspace.margin_curves",
    # a look
    "show": "visualization.playback",
    "playback": "visualization.playback",
    "Playback": "visualization.playback",
    "figures": "visualization.figures",
    # files
    "save": "io.results",
    "load": "io.results",
    "check": "verification.check",
    "CheckReport": "verification.check",
    # many cases
    "load_study": "studies.study",
    "Study": "studies.study",
    "run_study": "studies.runner",
    # errors
    "FreeFloatError": "errors",
    "InputError": "errors",
}
__all__ = list(_ROOMS)  # in the order in which they are needed


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("freefloat")
    if name not in _ROOMS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(f"{__name__}.{_ROOMS[name]}"), name)
    return value


def __dir__() -> list[str]:
    return __all__
