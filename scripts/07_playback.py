"""Two motions side by side in MeshCat: one follows the path, the other becomes singular.

``python scripts/07_playback.py`` writes playback.html, which any browser plays without a network,
and ends in the angle between the final attitudes of the two spacecraft [degrees].

The page contains robot, path and motions. It can be mailed, or embedded as below.
"""

from typing import Any

import numpy as np

import freefloat as ff

problem = ff.load_scenario("planar_3dof/parabola").problem()


def from_heading(degrees: float) -> Any:
    """The motion of arm branch 0 from a heading of the spacecraft."""
    half = np.radians(degrees) / 2.0
    return ff.simulate(problem, [0.0, 0.0, np.sin(half), np.cos(half)], branch=0).chosen.motion


feasible, singular = from_heading(200.0), from_heading(140.0)
for name, motion in (("feasible", feasible), ("singular", singular)):
    print(f"{name}: {motion.ending.value} {motion.final.time:.4f} s")

# The trail behind the end-effector is coloured by the margin; areas can be shown and hidden.
playback = ff.playback(
    {"from 200 degrees": feasible, "from 140 degrees": singular}, title="Example 1"
)
print("written:", playback.save("playback.html"))
print(f"{', '.join(playback.titles)}; {playback.duration:g} s")

# `playback.show()` opens the page in a browser or a notebook's cell. `playback.into(visualizer)`
# sends the scene to a `meshcat.Visualizer()`, shows the first instant and plays the animation.

# Numbers of a motion at any times, such as the end of the shorter one:
end = singular.final.time
state = feasible.sample([end])[0]
print("joints of the feasible motion then:", np.round(state.joints, 4))
apart = ff.so3.angle_between(state.attitude, singular.final.attitude)
print(f"apart: {np.degrees(apart):.4f} deg")
