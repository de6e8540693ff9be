"""A plan for a mission: a tumbling client, Sun, Earth, turn and wheels.

``python scripts/09_inspect_a_client.py`` ends in how far [deg] the limits move the attitude.

A servicer of 300 kg holds a camera with a UR5. The camera flies an arc before a client with solar
arrays that tumbles at 2.7 deg/s, and may roll about its line of sight. The client must not be hit,
the antenna must see the Earth, the star tracker must not see the Sun, and the spacecraft may turn
by 5 deg at most. Its wheels hold 0.6 N m s. ``freefloat models servicing/inspect_client`` prints
the scenario.
"""

from dataclasses import replace

import numpy as np

import freefloat as ff

scenario = ff.load_scenario("servicing/inspect_client")

# The plan compares motions from 1,024 attitudes within 60 deg of the present one, by margin, turn
# and joint rates. Each row is the extreme value of a limit along the whole chosen motion.
plan = scenario.plan()
print(f"attitude {plan.chosen.motion.initial.attitude.round(2)}: {plan.reason}")
for result in plan.limit_results:
    print(f"  {result.limit:12} {result.ratio:4.0%} of the limit, {result.where}")

# The page of the motion. The antenna's axis stays inside the green cone, that of the star
# tracker outside the red one; the corridor is the cone before the client.
ff.playback(plan, "inspect_client").save("inspect_client.html")
print("page: inspect_client.html")

# The angles over time. The star tracker comes near to the Sun, and the spacecraft turns, because
# wheels that hold all momentum at the present attitude hold only a part of it at another one.
ff.figures(plan)["angles"].savefig("angles.png", dpi=150)
print("drawn: angles.png")

# Without the cones another attitude has a better sum. From there both would be violated:
free = ff.plan(scenario.problem(), plan.search, replace(plan.limits, pointing=()))
for limit in plan.limits.pointing:
    results = ff.check_limits(free.chosen.motion, ff.Limits(pointing=[limit]))
    worst = next(result for result in results if result.limit == "pointing")
    print(f"{limit.keep} {np.degrees(limit.angle):.0f} deg: {np.degrees(worst.worst):.0f} deg")

# A second implementation integrates the motion again, and MuJoCo simulates it.
ff.save(plan, "plan.h5")
print(f"verified: {ff.check(ff.load('plan.h5'), 'mujoco').passed}")
ff.export(plan, "plan.csv")

attitudes = [result.chosen.motion.initial.attitude for result in (plan, free)]
print(f"moved by the cones: {np.degrees(ff.so3.angle_between(*attitudes)):.1f} deg")
