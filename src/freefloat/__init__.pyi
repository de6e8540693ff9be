# The robot
# The path
from . import paths as paths
from .dynamics.measures import singularity_measure as singularity_measure
from .dynamics.momentum import Task as Task
from .dynamics.momentum import generalized_jacobian as generalized_jacobian
from .dynamics.resolved_rates import Redundancy as Redundancy

# Errors
from .errors import FreeFloatError as FreeFloatError
from .errors import InputError as InputError
from .io.results import load as load
from .io.results import save as save
from .io.scenario import load_scenario as load_scenario
from .limits.check import check_limits as check_limits
from .limits.limits import Limits as Limits
from .motion.extrema import closest_approach as closest_approach
from .motion.integration import integrate_motion as integrate_motion

# The problem
from .motion.problem import Margin as Margin
from .motion.problem import Problem as Problem
from .paths.path import EndEffectorPath as EndEffectorPath
from .paths.timing import TimedPath as TimedPath
from .paths.timing import Timing as Timing
from .planning.mapping import attitude_map as attitude_map

# All attitudes
from .planning.plan import Search as Search
from .planning.planner import plan as plan

# One motion
from .planning.simulation import simulate as simulate
from .robot.model import FreeFloatingModel as FreeFloatingModel
from .robot.parts import Payload as Payload
from .robot.parts import Spacecraft as Spacecraft
from .studies.runner import run_study as run_study

# Many runs
from .studies.study import load_study as load_study

# Files and pictures
from .verification.check import check as check
from .visualization.figures import figures as figures
from .visualization.playback import playback as playback
from .visualization.playback import show as show
from .workspace.regions import workspace_regions as workspace_regions
