"""A plan that keeps limits of joint rates, torques, base rate and clearance.

``python scripts/06_plan_with_limits.py`` ends in the duration [s] that a tenth of the joint rates
would need.

Limits are checked along the whole motion, also between its samples. If the best motion violates
one, others are tried.
"""

from dataclasses import replace
from typing import Any

import freefloat as ff

scenario = ff.load_scenario("planar_2dof/line")
plan = scenario.plan()  # with the limits of the file; joint ranges always apply
problem, limits = plan.problem, plan.limits
print(f"chosen for {plan.reason}")


def show(results: tuple[Any, ...]) -> None:
    """Print the extreme value of every limit."""
    for result in results:
        verdict = "kept" if result.kept else "violated"
        print(
            f"  {result.limit:12} {result.ratio:7.2%} of the limit at {result.time:7.3f} s, "
            f"{result.where}: {verdict}"
        )


show(plan.limit_results)

# The motion, from light to dark:
ff.figures(plan)["snapshots"].savefig("snapshots.png")
print("drawn: snapshots.png")

# Any motion can be checked against any limits, such as a tenth of the joint rates:
slow = replace(limits, joint_rate=limits.joint_rate / 10.0)
results = ff.check_limits(plan.chosen.motion, slow)
print("with slow joints")
show(results)

# Without momentum a longer duration scales all joint rates alike.
longer = problem.stretched(max(result.stretch for result in results))
start = plan.chosen.motion.initial
motion = ff.simulate(longer, start.attitude, joints=start.joints).chosen.motion
print("with slow joints and more time")
show(ff.check_limits(motion, slow))
print(f"duration: {longer.path.duration:.3f} s instead of {problem.path.duration:g} s")
