"""From the table to orbit: what a testbed shows of a motion in space, and what it does not.

``python scripts/12_from_the_table_to_orbit.py`` ends in the margins of the same path on an air
bearing table and in free space. ``freefloat models ur5_servicer/table`` prints the scenario.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import freefloat as ff

# On the table the base moves along x and y and turns about z; its attitudes are headings.
table = ff.load_scenario("ur5_servicer/table").problem()
print(f"base: {table.model.base}")
plan = ff.plan(table, ff.load_scenario("ur5_servicer/table").search())
print(f"on the table: {plan.reason}")
start = plan.motion.initial

# In orbit nothing carries the other three motions. Positions count from the centre of mass, on the
# table from below it at the height of the base: the path is lowered to begin at the same place.
model = replace(table.model, base="free")
lowered = model.base_position(start.attitude, start.joints) - start.base_position
points = np.array([[0.75, -0.3, 0.7], [0.85, 0.0, 0.85], [0.75, 0.35, 0.75]]) + lowered
law = table.path.path.orientation
path = ff.TimedPath(ff.EndEffectorPath(ff.paths.SplineCurve(points), law), table.path.timing)
orbit = table.replace(model=model, path=path, limits=None)

# The same start: the arm moves the base in six directions instead of three.
moved = ff.simulate(orbit, start.attitude, joints=start.joints)
motions = {"table": plan.motion, "orbit": moved.motion}
figure, panels = plt.subplots(2, 1, sharex=True, figsize=(6, 4.5))
for name, motion in motions.items():
    times = np.linspace(0.0, motion.final.time, 200)
    states = motion.sample(times)
    measure = motion.problem.margin.measure(np.array([state.joints for state in states]))
    attitudes = np.array([state.attitude for state in states])
    panels[0].plot(times, np.abs(measure), label=name)
    panels[1].plot(times, np.degrees(ff.so3.angle_between(attitudes, start.attitude)), label=name)
    turn = np.degrees(ff.so3.angle_between(motion.final.attitude, start.attitude))
    print(f"{name}: {motion.ending.value} The spacecraft turns by {turn:.2f} deg")
panels[0].set_ylabel("|det S*| [m³]")
panels[1].set_ylabel("turn of the base [deg]")
panels[1].set_xlabel("time [s]")
panels[0].legend()
figure.savefig("table_and_orbit.png", dpi=150, bbox_inches="tight")

# In orbit all of SO(3) is open: the map of attitudes says how many serve.
attitudes = ff.attitude_map(orbit, 512)
print(f"in orbit: {100.0 * attitudes.feasible_fraction:.1f} % of the attitudes are feasible")
margins = [ff.closest_approach(motion, motion.problem.margin.measure).value
           for motion in motions.values()]  # fmt: skip
print("smallest |det S*|: {:.4f} on the table, {:.4f} in orbit".format(*margins))
