"""Compare certified boxes of the joint space with det A at random configurations.

Det A is computed from Pinocchio's matrices, the boxes come from the polynomial. A configuration
contradicts its box where det A has another sign than is certified, or is zero.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np

import freefloat as ff
from freefloat.beyond.joint_space.singularity_map import Kind
from freefloat.dynamics.joint_space import joint_box
from freefloat.singularities.singularity_polynomial import determinants

MAPS = {
    "planar_2dof/line": (0.1, {}),
    "planar_3dof/parabola": (0.1, {}),
    "spatial_6dof/line": (1.0, {"q4": 0.0}),
    "ets_vii/line": (15.0, {}),
    "ur5_servicer/arc": (5.0, {}),
    "panda_servicer/line": (5.0, {"panda_joint1": 0.4, "panda_joint2": -0.5, "panda_joint3": 1.0}),
    "ssrms/transfer": (5.0, {"shoulder_roll": 0.4, "shoulder_yaw": -0.5, "shoulder_pitch": 1.0}),
}
BATCH = 20_000
TITLES = ("boxes", "free [%]", "singular [%]", "undecided [%]", "time [s]", "configurations",
          "certified", "contradictions")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--configurations", type=int, default=10_000_000, help="in all")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    each = arguments.configurations // len(MAPS)
    wrong = 0
    print(f"{'map':22}" + "".join(f"{title:>15}" for title in TITLES))
    for name, (degrees, fixed) in MAPS.items():
        problem = ff.load_scenario(name).problem()
        model, task = problem.model, problem.task
        began = time.perf_counter()
        found = ff.singularity_map(model, task, np.radians(degrees), fixed=fixed)
        seconds = time.perf_counter() - began
        rng = np.random.default_rng(arguments.seed)
        lower, upper = joint_box(model)
        certified = contradictions = 0
        for first in range(0, each, BATCH):
            q = rng.uniform(lower, upper, (min(BATCH, each - first), model.dof))
            for joint, value in fixed.items():
                q[:, model.joint_names.index(joint)] = value
            kinds = found.kinds(q)
            signs = {Kind.POSITIVE: 1.0, Kind.NEGATIVE: -1.0}
            S = np.sign(determinants(model, q, task))
            for kind, sign in signs.items():
                certified += np.count_nonzero(kinds == kind)
                contradictions += np.count_nonzero(S[kinds == kind] != sign)
        wrong += contradictions
        volumes = [100.0 * found.volumes[kind] for kind in Kind]
        numbers = (
            f"{found.boxes:,}", f"{volumes[0] + volumes[1]:.3f}", f"{volumes[2]:.3f}",
            f"{volumes[3]:.3f}", f"{seconds:.1f}", f"{each:,}", f"{certified:,}",
            f"{contradictions:,}",
        )  # fmt: skip
        print(f"{name:22}" + "".join(f"{number:>15}" for number in numbers), flush=True)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
