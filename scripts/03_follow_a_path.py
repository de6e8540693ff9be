"""Follow a straight line from an attitude that the paper warns against (its Example 2).

``python scripts/03_follow_a_path.py`` ends in the time [s] at which one of the eight arm branches
becomes dynamically singular.
"""

from pathlib import Path

import numpy as np

import freefloat as ff
from freefloat.robot.names import find_robot
from freefloat.so3 import axes_rotation

task = ff.Task.POSE  # position and attitude of the end-effector count
model = ff.FreeFloatingModel.from_urdf(find_robot("spatial_6dof", Path()))

# Where the end-effector goes, from the centre of mass of the whole system [m], and how it stands.
line = ff.paths.PolynomialCurve.line([1, 0, 0], [-0.5, 0.8, 0.33])
axes = axes_rotation("attitude", ("x", [0.4683, 1.1683, -0.7]), ("z", [1.5, -0.8, -0.33]))
path = ff.EndEffectorPath(line, ff.paths.FixedOrientation(axes))

# When: from rest to rest in 100 s. And what must never fall below 5 on the way.
timed = ff.TimedPath(path, ff.Timing(duration=100.0))
margin = ff.Margin(ff.singularity_measure(model, task, "arm"), 5.0)
momentum = np.array([0.5, 0.3, 0.1])  # that the system drifts with [N m s]
problem = ff.Problem(model, timed, task, momentum, margin)

simulation = ff.simulate(problem, attitude=[0.1, 0.5, 0.2, -0.8367])
for one in simulation.branches:
    closest = one.closest_approach
    closest = f"least |{closest.measure}| {closest.value:8.4f} at {closest.time:8.4f} s"
    print(f"{one.branch.index} {one.branch.label:28} {closest}  {one.motion.ending.value}")

# A motion can be asked for its state at any time, and proves itself.
motion = simulation.chosen.motion
print("joints at 50 s:", np.round(motion.sample([50.0])[0].joints, 4))
print("off by", motion.residuals())

lost = [one for one in simulation.branches if not one.motion.completed]
print(f"branch {lost[0].branch.index} becomes singular at {lost[0].motion.final.time:.4f} s")
