"""Follow a straight line from an attitude that the paper warns against (its Example 2).

``python scripts/03_follow_a_path.py`` ends in the time [s] at which one of the eight arm branches
becomes dynamically singular.

A problem consists of a robot, a task, a timed path, the momentum and the margin. A motion is
integrated for each arm branch that reaches the start of the path.
"""

import numpy as np

import freefloat as ff

# The path: position [m], from the centre of mass of the system, and orientation.
line = ff.paths.PolynomialCurve.line([1, 0, 0], [-0.5, 0.8, 0.33])
axes = ff.so3.axes_rotation("attitude", ("x", [0.4683, 1.1683, -0.7]), ("z", [1.5, -0.8, -0.33]))
path = ff.EndEffectorPath(line, ff.paths.FixedOrientation(axes))

# From rest to rest in 100 s. The magnitude of the measure must not fall below 5.
problem = ff.Problem(
    "spatial_6dof",
    path=path,
    duration=100.0,
    momentum=[0.5, 0.3, 0.1],  # angular momentum [N m s]
    margin=("in-plane factor", 5.0),
)
print(f"task: {problem.task}, of {problem.model.dof} joints")

# The motions of all arm branches from one attitude of the spacecraft (x, y, z, w):
simulation = ff.simulate(problem, attitude=[0.1, 0.5, 0.2, -0.8367])
for arm in simulation.branches:
    closest = arm.closest_approach
    minimum = f"minimum |{closest.measure}| {closest.value:8.4f} at {closest.time:8.4f} s"
    print(f"{arm.branch.index} {arm.branch.label:28} {minimum}  {arm.motion.ending.value}")

# The state at any time, and the residuals of the motion.
motion = simulation.chosen.motion
print("joints at 50 s:", np.round(motion.sample([50.0])[0].joints, 4))
print("residuals:", motion.residuals())

# Joints, attitude and their rates over time; the record has more figures.
ff.figures(simulation)["motion"].savefig("motion.png")
print("drawn: motion.png")

# Other branches meet a dynamic singularity.
singular = next(arm for arm in simulation.branches if not arm.motion.completed)
print(f"branch {singular.branch.index} becomes singular at {singular.motion.final.time:.4f} s")
