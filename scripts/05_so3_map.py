"""A map of SO(3): the minimum margin of every initial attitude, in numbers and a figure.

``python scripts/05_so3_map.py`` draws so3_map.png and ends in the percentage of attitudes with a
feasible arm branch.

In space the feasible set has no closed form. Motions from many attitudes are integrated together,
with every arm branch; the more attitudes, the finer the map.
"""

import numpy as np

import freefloat as ff

SAMPLES = 512  # attitudes, evenly spread; 36,864 make a fine map

problem = ff.load_scenario("spatial_6dof/line").problem()
# With refine=True regions are found, and the best and most robust attitudes between the samples.
result = ff.attitude_map(problem, SAMPLES, refine=True)
print(f"{result.motions:,} motions integrated")

# Connected regions of feasible attitudes of each arm branch, and the attitude deepest inside.
for region in result.regions[:4]:
    centre = np.array2string(region.centre, precision=4)
    print(f"branch {region.branch}: {region.fraction:.1%} of SO(3), {centre} (x y z w) is")
    print(f"  {np.degrees(region.depth):.1f} deg from the nearest infeasible sample")

# All samples are available: the attitude with the largest margin, and its arm branch.
sample, branch = np.unravel_index(np.argmax(result.margins), result.margins.shape)
print(f"largest margin {result.margins.max():.2f}: {result.attitudes[sample]}, branch {branch}")

ff.figures(result)["map_histogram"].savefig("so3_map.png")
print("drawn: so3_map.png")
print(f"feasible: {result.feasible_fraction:.2%} of {SAMPLES:,} attitudes")
