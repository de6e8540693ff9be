"""How near to a singularity every initial attitude leads: a map of SO(3), in numbers and a picture.

``python scripts/05_so3_map.py`` draws so3_map.png and ends in the share of the attitudes from which
some arm branch keeps the margin [%].
"""

from pathlib import Path

import numpy as np

import freefloat as ff
from freefloat.planning.regions import find_regions
from freefloat.visualization.figure_style import save_figures
from freefloat.visualization.map_figures import histogram_figure

SAMPLES = 512  # attitudes, evenly spread; 36,864 make a fine map

problem = ff.load_scenario("spatial_6dof/line").problem()
found = ff.attitude_map(problem, SAMPLES)
print(f"{found.motions:,} motions followed")

# Attitudes that hang together, arm branch by arm branch, and the one deepest inside.
for region in find_regions(found)[:4]:
    centre = np.array2string(region.centre, precision=4)
    print(f"branch {region.branch}: {region.fraction:.1%} of SO(3), {centre} (x y z w) is")
    print(f"  {np.degrees(region.depth):.1f} deg from the nearest sample that does not serve")

# Every sample is at hand: the attitude with the largest margin of all, and its arm branch.
sample, branch = np.unravel_index(np.argmax(found.margins), found.margins.shape)
print(f"largest margin {found.margins.max():.2f}: {found.attitudes[sample]}, branch {branch}")

files = save_figures(Path(), {"so3_map": histogram_figure(found)})
print("drawn:", ", ".join(str(file) for file in files))
print(f"feasible: {found.feasible_fraction:.2%} of {SAMPLES:,} attitudes")
