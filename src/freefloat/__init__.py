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
    from freefloat.attitudes.attitude_map import AttitudeMap as AttitudeMap
    from freefloat.attitudes.attitude_map import map_attitudes as map_attitudes
    from freefloat.attitudes.outlook import Outlook as Outlook
    from freefloat.errors import FreeFloatError as FreeFloatError
    from freefloat.errors import InputError as InputError
    from freefloat.figures.plots import plan_figures as plan_figures
    from freefloat.limits.limit_checks import LimitChecker as LimitChecker
    from freefloat.limits.limits import LimitFinding as LimitFinding
    from freefloat.limits.limits import Limits as Limits
    from freefloat.machine.dynamics import Task as Task
    from freefloat.machine.dynamics import generalized_jacobian as generalized_jacobian
    from freefloat.machine.model import FreeFloatingModel as FreeFloatingModel
    from freefloat.machine.redundancy import Redundancy as Redundancy
    from freefloat.machine.singularity import measure as measure
    from freefloat.motion.closeness import Least as Least
    from freefloat.motion.closeness import least as least
    from freefloat.motion.integration import integrate_motion as integrate_motion
    from freefloat.motion.motion import Ending as Ending
    from freefloat.motion.motion import Motion as Motion
    from freefloat.motion.problem import Margin as Margin
    from freefloat.motion.problem import Problem as Problem
    from freefloat.motion.simulation import Simulation as Simulation
    from freefloat.motion.simulation import simulate as simulate
    from freefloat.motion.time_series import TimeSeries as TimeSeries
    from freefloat.plans.planner import plan as plan
    from freefloat.plans.plans import Plan as Plan
    from freefloat.playback.playback import Playback as Playback
    from freefloat.playback.playback import play as play
    from freefloat.scenario.scenario import Scenario as Scenario
    from freefloat.scenario.scenario import load_scenario as load_scenario
    from freefloat.storage.map_file import load_map as load_map
    from freefloat.storage.plan_file import load_plan as load_plan
    from freefloat.storage.saving import save_map as save_map
    from freefloat.storage.saving import save_plan as save_plan
    from freefloat.studies.study import Study as Study
    from freefloat.studies.study import load_study as load_study
    from freefloat.tasks.batching import run_study as run_study
    from freefloat.urdf.parts import Attachment as Attachment
    from freefloat.urdf.parts import Mount as Mount
    from freefloat.urdf.parts import Payload as Payload
    from freefloat.urdf.parts import Spacecraft as Spacecraft
    from freefloat.wish.attitude_law import DirectedAttitude as DirectedAttitude
    from freefloat.wish.attitude_law import FixedAttitude as FixedAttitude
    from freefloat.wish.attitude_law import SlerpAttitude as SlerpAttitude
    from freefloat.wish.curve import ArcCurve as ArcCurve
    from freefloat.wish.curve import PolynomialCurve as PolynomialCurve
    from freefloat.wish.curve import SplineCurve as SplineCurve
    from freefloat.wish.path import EndEffectorPath as EndEffectorPath
    from freefloat.wish.search import Objective as Objective
    from freefloat.wish.search import Search as Search
    from freefloat.wish.timing import Stop as Stop
    from freefloat.wish.timing import TimedPath as TimedPath
    from freefloat.wish.timing import TimeLaw as TimeLaw
    from freefloat.wish.timing import Timing as Timing

_ROOMS = {
    # the machine
    "FreeFloatingModel": "machine.model",
    "Mount": "urdf.parts",
    "Spacecraft": "urdf.parts",
    "Payload": "urdf.parts",
    "Attachment": "urdf.parts",
    "Task": "machine.dynamics",
    "generalized_jacobian": "machine.dynamics",
    "measure": "machine.singularity",
    "Redundancy": "machine.redundancy",
    # the wish
    "PolynomialCurve": "wish.curve",
    "ArcCurve": "wish.curve",
    "SplineCurve": "wish.curve",
    "FixedAttitude": "wish.attitude_law",
    "SlerpAttitude": "wish.attitude_law",
    "DirectedAttitude": "wish.attitude_law",
    "EndEffectorPath": "wish.path",
    "Timing": "wish.timing",
    "TimeLaw": "wish.timing",
    "Stop": "wish.timing",
    "TimedPath": "wish.timing",
    "Margin": "motion.problem",
    "Problem": "motion.problem",
    # or both from a file
    "load_scenario": "scenario.scenario",
    "Scenario": "scenario.scenario",
    # one motion
    "simulate": "motion.simulation",
    "Simulation": "motion.simulation",
    "integrate_motion": "motion.integration",
    "Motion": "motion.motion",
    "Ending": "motion.motion",
    "least": "motion.closeness",
    "Least": "motion.closeness",
    "TimeSeries": "motion.time_series",
    # its limits
    "Limits": "limits.limits",
    "LimitFinding": "limits.limits",
    "LimitChecker": "limits.limit_checks",
    # a plan
    "plan": "plans.planner",
    "Plan": "plans.plans",
    "Search": "wish.search",
    "Objective": "wish.search",
    # a map
    "Outlook": "attitudes.outlook",
    "map_attitudes": "attitudes.attitude_map",
    "AttitudeMap": "attitudes.attitude_map",
    # a look
    "play": "playback.playback",
    "Playback": "playback.playback",
    "plan_figures": "figures.plots",
    # files
    "save_plan": "storage.saving",
    "save_map": "storage.saving",
    "load_plan": "storage.plan_file",
    "load_map": "storage.map_file",
    # many cases
    "load_study": "studies.study",
    "Study": "studies.study",
    "run_study": "tasks.batching",
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
