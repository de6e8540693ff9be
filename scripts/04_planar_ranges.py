"""All feasible initial headings of a planar arm (the paper's Example 1).

``python scripts/04_planar_ranges.py`` ends in the heading [degrees] with the largest margin.

For planar arms with two or three revolute joints the ranges of feasible headings are found exactly,
not by sampling. Here they are compared with motions on both sides of an end.
"""

import numpy as np

import freefloat as ff

# A scenario file contains robot, path, timing and margin; this one is bundled.
problem = ff.load_scenario("planar_3dof/parabola").problem()
plan = ff.plan(problem)

# The ranges are exact: motions from their ends touch the margin curve. The paper prints
# 161 and 63 degrees for the first branch.
for branch in plan.ranges:
    ranges = [f"[{low:.4f}, {high:.4f}]" for low, high in branch.degrees]
    print(f"branch {branch.branch} {branch.label}: {'  '.join(ranges)} deg")

# Compared with motions on both sides of an end of the first branch's first range:
end = plan.ranges[0].ranges[0].high
for heading in (end - 1e-3, end + 1e-3):
    quaternion = [0.0, 0.0, np.sin(heading / 2), np.cos(heading / 2)]
    simulated = ff.simulate(problem, quaternion, branch=plan.ranges[0].branch).chosen
    kept = problem.margin.keeps(simulated.closest_approach.value)
    print(
        f"from {np.degrees(heading) % 360:.4f} deg the margin is {'kept' if kept else 'not kept'}"
    )

# In joint space the singularities are curves that no motion may cross.
ff.figures(plan)["joint_space"].savefig("joint_space.png")
print("drawn: joint_space.png")

# Of all feasible headings the plan has chosen one.
_, _, z, w = plan.chosen.motion.initial.attitude
print(f"chosen for {plan.reason}")
print(f"heading: {np.degrees(2 * np.arctan2(z, w)) % 360:.4f} deg")
