"""Free-floating space manipulators: from which attitudes a path avoids dynamic singularities.

From a URDF to a plan, and to MeshCat::

    import freefloat as ff
    import numpy as np

    task = ff.Task.POSE
    model = ff.FreeFloatingModel.from_urdf("robot.urdf", "end_effector")
    curve = ff.PolynomialCurve.line([1, 0, 0], [-0.5, 0.8, 0.33])  # from the centre of mass [m]
    path = ff.EndEffectorPath(curve, ff.FixedAttitude(np.eye(3)))
    timed = ff.TimedPath(path, ff.Timing(duration=100))  # [s]
    margin = ff.Margin(ff.measure(model, task, "gjm"), 0.02)
    problem = ff.Problem(model, timed, task, np.array([0.5, 0.3, 0.1]), margin)  # [N m s]
    plan = ff.plan(problem, ff.Search(samples=1024))
    print(plan.reason, plan.chosen.motion.initial.attitude)
    plan.show()  # in a browser, or the notebook's cell

The same from a scenario file: ``problem = ff.load_scenario("spatial_6dof/line").problem()``.
Quaternions are x, y, z, w, units SI and radians; what cannot be used raises :class:`InputError`,
which tells the key, what is wrong with it and what is accepted. Arrays of results are read-only.
Names are loaded when first used, so that ``import freefloat`` costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from freefloat.attitude_law import DirectedAttitude as DirectedAttitude
    from freefloat.attitude_law import FixedAttitude as FixedAttitude
    from freefloat.attitude_law import SlerpAttitude as SlerpAttitude
    from freefloat.attitude_map import AttitudeMap as AttitudeMap
    from freefloat.attitude_map import map_attitudes as map_attitudes
    from freefloat.batching import run_study as run_study
    from freefloat.closeness import Least as Least
    from freefloat.closeness import least as least
    from freefloat.curve import ArcCurve as ArcCurve
    from freefloat.curve import PolynomialCurve as PolynomialCurve
    from freefloat.curve import SplineCurve as SplineCurve
    from freefloat.dynamics import Task as Task
    from freefloat.dynamics import generalized_jacobian as generalized_jacobian
    from freefloat.errors import FreeFloatError as FreeFloatError
    from freefloat.errors import InputError as InputError
    from freefloat.integration import integrate_motion as integrate_motion
    from freefloat.limit_checks import LimitChecker as LimitChecker
    from freefloat.limits import LimitFinding as LimitFinding
    from freefloat.limits import Limits as Limits
    from freefloat.map_file import load_map as load_map
    from freefloat.model import FreeFloatingModel as FreeFloatingModel
    from freefloat.motion import Ending as Ending
    from freefloat.motion import Motion as Motion
    from freefloat.outlook import Outlook as Outlook
    from freefloat.parts import Attachment as Attachment
    from freefloat.parts import Mount as Mount
    from freefloat.parts import Payload as Payload
    from freefloat.parts import Spacecraft as Spacecraft
    from freefloat.path import EndEffectorPath as EndEffectorPath
    from freefloat.plan_file import load_plan as load_plan
    from freefloat.planner import plan as plan
    from freefloat.plans import Plan as Plan
    from freefloat.playback import Playback as Playback
    from freefloat.playback import play as play
    from freefloat.problem import Margin as Margin
    from freefloat.problem import Problem as Problem
    from freefloat.redundancy import Redundancy as Redundancy
    from freefloat.scenario import Scenario as Scenario
    from freefloat.scenario import load_scenario as load_scenario
    from freefloat.search import Objective as Objective
    from freefloat.search import Search as Search
    from freefloat.simulation import Simulation as Simulation
    from freefloat.simulation import simulate as simulate
    from freefloat.singularity import measure as measure
    from freefloat.study import Study as Study
    from freefloat.study import load_study as load_study
    from freefloat.time_series import TimeSeries as TimeSeries
    from freefloat.timing import TimedPath as TimedPath
    from freefloat.timing import Timing as Timing

_ROOMS = {
    # the machine
    "FreeFloatingModel": "model",
    "Mount": "parts",
    "Spacecraft": "parts",
    "Payload": "parts",
    "Attachment": "parts",
    "Task": "dynamics",
    "generalized_jacobian": "dynamics",
    "measure": "singularity",
    "Redundancy": "redundancy",
    # the wish
    "PolynomialCurve": "curve",
    "ArcCurve": "curve",
    "SplineCurve": "curve",
    "FixedAttitude": "attitude_law",
    "SlerpAttitude": "attitude_law",
    "DirectedAttitude": "attitude_law",
    "EndEffectorPath": "path",
    "Timing": "timing",
    "TimedPath": "timing",
    "Margin": "problem",
    "Problem": "problem",
    # or both from a file
    "load_scenario": "scenario",
    "Scenario": "scenario",
    # one motion
    "simulate": "simulation",
    "Simulation": "simulation",
    "integrate_motion": "integration",
    "Motion": "motion",
    "Ending": "motion",
    "least": "closeness",
    "Least": "closeness",
    "TimeSeries": "time_series",
    # its limits
    "Limits": "limits",
    "LimitFinding": "limits",
    "LimitChecker": "limit_checks",
    # a plan
    "plan": "planner",
    "Plan": "plans",
    "Search": "search",
    "Objective": "search",
    # a map
    "Outlook": "outlook",
    "map_attitudes": "attitude_map",
    "AttitudeMap": "attitude_map",
    # a look
    "play": "playback",
    "Playback": "playback",
    # files
    "load_plan": "plan_file",
    "load_map": "map_file",
    # many cases
    "load_study": "study",
    "Study": "study",
    "run_study": "batching",
    # errors
    "FreeFloatError": "errors",
    "InputError": "errors",
}
__all__ = list(_ROOMS)  # in the order in which they are needed


def __getattr__(name: str) -> Any:
    if name not in _ROOMS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(f"{__name__}.{_ROOMS[name]}"), name)
    return value


def __dir__() -> list[str]:
    return __all__
