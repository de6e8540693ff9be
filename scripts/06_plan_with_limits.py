"""A plan that keeps joint rates, torques, the spacecraft's rate and distances.

``python scripts/06_plan_with_limits.py`` ends in the duration [s] that a tenth of the joint rates
would need.
"""

from dataclasses import replace

import freefloat as ff
from freefloat.limits.limits import needed_stretch

scenario = ff.load_scenario("planar_2dof/line")
problem = scenario.problem()
limits = scenario.limits()  # what the file says under "limits:"; joint ranges count as well

plan = ff.plan(problem, limits=limits)
print(f"chosen for {plan.reason}")


def tell(findings: tuple[ff.LimitResult, ...]) -> None:
    """Every limit where it is nearest to being broken."""
    for one in findings:
        verdict = "kept" if one.kept else "broken"
        print(
            f"  {one.limit:12} {one.ratio:7.2%} used at {one.time:7.3f} s, {one.where}: {verdict}"
        )


tell(plan.limit_results)

# Any motion can be held against any limits, such as joints that are a tenth as fast:
slow = replace(limits, joint_rate=limits.joint_rate / 10.0)
findings = ff.LimitChecker(problem, slow).findings(plan.chosen.motion)
print("with slow joints")
tell(findings)

# Without momentum the same motion in more time is slower by as much, joint for joint.
longer = scenario.stretched(needed_stretch(findings)).problem()
start = plan.chosen.motion.initial
motion = ff.simulate(longer, start.attitude, joints=start.joints).chosen.motion
print("with slow joints and more time")
tell(ff.LimitChecker(longer, slow).findings(motion))
print(f"duration: {longer.path.duration:.3f} s instead of {problem.path.duration:g} s")
