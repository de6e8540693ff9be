"""Every initial heading from which a planar arm can follow its path (the paper's Example 1).

``python scripts/04_planar_ranges.py`` ends in the heading [degrees] that keeps farthest from
singularities.
"""

import numpy as np

import freefloat as ff

# A scenario is a file that says robot, path, timing and margin; this one is bundled.
problem = ff.load_scenario("planar_3dof/parabola_nonstop").problem()
plan = ff.plan(problem)

# The ranges are exact: their ends are motions that just touch the margin.
for branch in plan.ranges:
    told = [f"[{np.degrees(one.low):.4f}, {np.degrees(one.high):.4f}]" for one in branch.ranges]
    print(f"branch {branch.branch} {branch.label}: {'  '.join(told)} deg")

# Held against motions, one at each side of an end of the first branch's first range:
end = plan.ranges[0].ranges[0].high
for heading in (end - 1e-3, end + 1e-3):
    quaternion = [0.0, 0.0, np.sin(heading / 2), np.cos(heading / 2)]
    followed = ff.simulate(problem, quaternion, branch=plan.ranges[0].branch).chosen
    kept = problem.margin.is_kept(followed.closest_approach.value)
    print(f"from {np.degrees(heading):.4f} deg the margin is {'kept' if kept else 'not kept'}")

_, _, z, w = plan.chosen.motion.initial.attitude
print(f"chosen for {plan.reason}")
print(f"heading: {np.degrees(2 * np.arctan2(z, w)) % 360:.4f} deg")
