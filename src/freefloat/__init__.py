"""Free-floating space manipulators: from which attitudes a path avoids dynamic singularities.

Names are loaded when first used, so that ``import freefloat`` costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from freefloat.attitude_map import AttitudeMap as AttitudeMap
    from freefloat.attitude_map import map_attitudes as map_attitudes
    from freefloat.closeness import Least as Least
    from freefloat.closeness import least as least
    from freefloat.dynamics import Task as Task
    from freefloat.dynamics import generalized_jacobian as generalized_jacobian
    from freefloat.errors import FreeFloatError as FreeFloatError
    from freefloat.errors import InputError as InputError
    from freefloat.integration import integrate_motion as integrate_motion
    from freefloat.limit_checks import LimitChecker as LimitChecker
    from freefloat.limits import LimitFinding as LimitFinding
    from freefloat.limits import Limits as Limits
    from freefloat.model import FreeFloatingModel as FreeFloatingModel
    from freefloat.motion import Ending as Ending
    from freefloat.motion import Motion as Motion
    from freefloat.outlook import Outlook as Outlook
    from freefloat.path import EndEffectorPath as EndEffectorPath
    from freefloat.planner import plan as plan
    from freefloat.plans import Plan as Plan
    from freefloat.playback import Playback as Playback
    from freefloat.playback import play as play
    from freefloat.problem import Margin as Margin
    from freefloat.problem import Problem as Problem
    from freefloat.redundancy import Redundancy as Redundancy
    from freefloat.scenario import load_scenario as load_scenario
    from freefloat.search import Objective as Objective
    from freefloat.search import Search as Search
    from freefloat.simulation import simulate as simulate
    from freefloat.singularity import measure as measure
    from freefloat.time_series import TimeSeries as TimeSeries
    from freefloat.timing import TimedPath as TimedPath
    from freefloat.timing import Timing as Timing

_ROOMS = {
    "AttitudeMap": "attitude_map",
    "map_attitudes": "attitude_map",
    "Least": "closeness",
    "least": "closeness",
    "Task": "dynamics",
    "generalized_jacobian": "dynamics",
    "FreeFloatError": "errors",
    "InputError": "errors",
    "integrate_motion": "integration",
    "LimitChecker": "limit_checks",
    "LimitFinding": "limits",
    "Limits": "limits",
    "FreeFloatingModel": "model",
    "Ending": "motion",
    "Motion": "motion",
    "Outlook": "outlook",
    "EndEffectorPath": "path",
    "Objective": "search",
    "Plan": "plans",
    "Search": "search",
    "plan": "planner",
    "Playback": "playback",
    "play": "playback",
    "Margin": "problem",
    "Problem": "problem",
    "Redundancy": "redundancy",
    "load_scenario": "scenario",
    "simulate": "simulation",
    "measure": "singularity",
    "TimeSeries": "time_series",
    "TimedPath": "timing",
    "Timing": "timing",
}
__all__ = sorted(_ROOMS)


def __getattr__(name: str) -> Any:
    if name not in _ROOMS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(f"{__name__}.{_ROOMS[name]}"), name)
    return value


def __dir__() -> list[str]:
    return __all__
