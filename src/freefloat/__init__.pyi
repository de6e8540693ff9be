__version__: str

# The paper: the robot
from .robot.model import FreeFloatingModel as FreeFloatingModel
from .dynamics.tasks import Task as Task
from .dynamics.system import System as System
from .dynamics.momentum import inertia_matrices as inertia_matrices
from .dynamics.generalized_jacobian import system_matrix as system_matrix
from .dynamics.generalized_jacobian import generalized_jacobian as generalized_jacobian
from .dynamics.measures import singularity_measure as singularity_measure

# The paper: the path
from . import paths as paths
from .paths.path import EndEffectorPath as EndEffectorPath
from .paths.timed_path import TimedPath as TimedPath
from .paths.timing import Timing as Timing

# The paper: the problem
from .motion.margin import Margin as Margin
from .motion.problem import Problem as Problem
from .io.scenario.loading import load_scenario as load_scenario

# The paper: one motion
from .motion.integration import integrate_motion as integrate_motion
from .motion.extrema import closest_approach as closest_approach
from .planning.simulation import simulate as simulate

# The paper: all attitudes
from .regions.workspace import workspace_regions as workspace_regions
from .regions.margin_curves import margin_curves as margin_curves
from .planning.touch_points import touch_points as touch_points
from .planning.space.map_sampling import attitude_map as attitude_map
from .planning.settings import Search as Search
from .planning.planner import plan as plan

# The paper: files, checks and pictures
from .io.results import load as load
from .io.results import save as save
from .verification.check import check as check
from .visualization.figures import figures as figures
from .visualization.page.playback import playback as playback
from .visualization.page.playback import show as show

# The paper: misuse
from .errors import InputError as InputError

# Beyond the paper: an arm on a spacecraft
from .robot.parts import Payload as Payload
from .robot.parts import Spacecraft as Spacecraft
from .robot.source import RobotSource as RobotSource

# Beyond the paper: joint space
from .beyond.joint_space.singularity_map import singularity_map as singularity_map

# Beyond the paper: surroundings and limits
from .robot.shapes import Box as Box
from .robot.shapes import Cylinder as Cylinder
from .robot.shapes import Sphere as Sphere
from .scene.scene import Corridor as Corridor
from .scene.scene import Scene as Scene
from .scene.scene_body import SceneBody as SceneBody
from .scene.tumbling import Tumbling as Tumbling
from .limits.limits import Limits as Limits
from .motion.pointing import PointingLimit as PointingLimit
from .limits.limits import check_limits as check_limits

# Beyond the paper: further arms, redundancy and wheels
from .dynamics.redundancy import Redundancy as Redundancy
from .motion.joint_curves import ArmCurve as ArmCurve

# Beyond the paper: timing
from .planning.timing.retiming import retime as retime

# Beyond the paper: goals and manoeuvres
from .beyond.missions.goals.goal import Goal as Goal
from .beyond.missions.goals.mover import move as move
from .beyond.missions.capture import Client as Client
from .beyond.missions.capture import capture as capture
from .beyond.missions.capture_phase import CapturePhase as CapturePhase
from .beyond.missions.goal_phase import GoalPhase as GoalPhase
from .beyond.missions.path_phase import PathPhase as PathPhase
from .beyond.missions.manoeuvre_planner import plan_manoeuvre as plan_manoeuvre

# Beyond the paper: engines and exports
from .io.export import export as export
from .beyond.engines.tracking import track as track

# Beyond the paper: many runs
from .ensemble.simulate_many import simulate_many as simulate_many
from .studies.loading import load_study as load_study
from .studies.runner import run_study as run_study

# Modules, imported on first use as well
from . import attitude_grids as attitude_grids
from . import errors as errors
from . import so3 as so3
