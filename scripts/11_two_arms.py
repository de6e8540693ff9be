"""Two arms: one inspects a client, the other is held, moves, or balances the spacecraft.

``python scripts/11_two_arms.py`` ends in the turn of the spacecraft with the balancing arm over
that with the arm held. ``freefloat models servicing/two_arms`` prints the scenario.
"""

from dataclasses import replace

import numpy as np

import freefloat as ff

# In the scenario the left arm is held: it is part of the spacecraft.
scenario = ff.load_scenario("servicing/two_arms")
attitude = [0.0, 0.0, 0.0, 1.0]
held = ff.simulate(scenario.problem(), attitude)
print(f"held: {held.reason}, {len(held.problem.model.joint_names)} joints move")

# The same robot with a left arm that moves: from a working posture, by a quarter turn of the wrist.
model = ff.FreeFloatingModel(
    held.problem.model.description, "tool0", {}, {"left": "left_tool0"}
)  # fmt: skip
start = np.array([0.72, -0.69, 0.88, 0.12, 0.21, 1.18])
curve = ff.ArmCurve.evenly([start, start + 1.57 * np.eye(6)[5]], held.problem.path.duration)
arms = ff.ArmCurves({"left": curve})
problem = held.problem.replace(model=model, arms=arms, limits=None)  # those were of fewer joints
moved = ff.simulate(problem, attitude)
joints = moved.chosen.branch.joints
print(f"moving: {moved.reason}, {len(model.joint_names)} joints move")

# The left arm balances: its joints keep the spacecraft's attitude while the right one works.
limits = replace(held.limits, joint_rate=np.full(model.dof, 0.2))
balance = ff.balance(
    problem, attitude, joints, ff.BalanceSettings("left", starts=1), limits
)  # fmt: skip
print(f"turn: {np.degrees(balance.turn):.2f} deg, held {np.degrees(balance.held_turn):.2f} deg")
print(f"at rate limits {balance.at_rate:.0%}, at ends of ranges {balance.at_range:.0%} of the time")

# What was found is a joint curve like any other: integrate it, check it, show it.
balanced = problem.replace(arms=ff.ArmCurves({"left": balance.curve}))
result = ff.simulate(balanced, attitude, joints=balance.joints, limits=limits)
ff.save(result, "balanced.h5")
print(f"verified: {ff.check(ff.load('balanced.h5'), 'mujoco').passed}")
ff.playback(result, "two_arms").save("two_arms.html")
print(f"ratio of the turns: {balance.ratio:.3f}")
