"""Two arms: one inspects a client, the other is held or moves along a joint curve.

``python scripts/11_two_arms.py`` ends in the turn of the spacecraft with the arm held and
moving. ``freefloat models servicing/two_arms`` prints the scenario.
"""

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
arms = {"left": curve}
problem = held.problem.replace(model=model, arms=arms, limits=None)  # those were of fewer joints
moved = ff.simulate(problem, attitude)
print(f"moving: {moved.reason}, {len(model.joint_names)} joints move")

# A file and a page have both arms; so have checks.
ff.save(moved, "moved.h5")
print(f"verified: {ff.check(ff.load('moved.h5'), 'mujoco').passed}")
ff.playback(moved, "two_arms").save("two_arms.html")

# How far the spacecraft turns, with the left arm held and with its wrist moving.
for name, result in (("held", held), ("moving", moved)):
    turn = 2.0 * np.arccos(np.abs(result.motion.attitudes @ attitude).min())
    print(f"{name}: the spacecraft turns by up to {np.degrees(turn):.2f} deg")
