"""Time a motion of maps of arms with three joints and with four, which follow positions.

An end-effector on the axis of the last joint, as in ``benchmarks.arm``, leaves that joint nothing
but its tiny effect on the spacecraft. Joint ranges and rates are limited.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.arm import arm_urdf

import freefloat as ff
from freefloat.ensemble.ensemble import EnsembleIntegrator

ATTITUDES, ROUNDS, SLOW = 512, 5, 1e7
RANGE, RATE = 3.0, 0.2
"""Limits of the joints [rad, rad/s]."""


def problem(joints: int, tool: float, held: dict[str, float] | None = None) -> ff.Problem:
    """A line of 0.4 m in 60 s; the end-effector is at a distance from the last axis [m]."""
    limited = arm_urdf(joints).replace('"-7" upper="7"', f'"{-RANGE}" upper="{RANGE}"')
    fixed = f'<joint name="mount" type="fixed"><parent link="link_{joints}"/><child link="tool"/>'
    fixed += f'<origin xyz="{tool} 0 0"/></joint><link name="tool"/></robot>'
    urdf = limited.replace("</robot>", fixed)
    model = ff.FreeFloatingModel.from_urdf(urdf, "tool", fixed_joints=held)
    measure = ff.singularity_measure(model, "position", "gjm")
    drawn = np.random.default_rng(5).uniform(-1.5, 1.5, (200, model.dof))
    usual = float(np.median(np.abs([measure(q) for q in drawn])))
    away = 0.75 * (0.5 * joints + tool)
    curve = ff.paths.PolynomialCurve.line([away, 0.0, 0.0], [away, 0.3, 0.25])
    path = ff.EndEffectorPath(curve, ff.paths.FixedOrientation(np.eye(3)))
    timed = ff.TimedPath(path, ff.Timing(60.0))
    margin = ff.Margin(measure, 0.01 * usual)
    return ff.Problem(model, timed, ff.Task.POSITION, np.zeros(3), margin)


def main() -> None:
    arms = {
        "3 joints, tool of 0.4 m": problem(3, 0.4),
        "4 joints, tool of 0.4 m": problem(4, 0.4),
        "4 joints, end-effector on the last axis": problem(4, 0.0),
        "the same, last joint held": problem(4, 0.0, {"q4": 0.0}),
    }
    maps = {name: mapped(posed) for name, posed in arms.items()}
    whole, kernels = ({name: list[float]() for name in arms} for _ in range(2))
    for round_ in range(ROUNDS):  # by turns; slow ones once
        for name, posed in arms.items():
            if round_ and maps[name].results.motions.evaluations.sum() > SLOW:
                continue
            exist = maps[name].results.exist
            attitudes = maps[name].attitudes[np.nonzero(exist)[0]]
            joints = maps[name].results.joints[exist].astype(float)
            start = time.process_time()
            mapped(posed)
            middle = time.process_time()
            EnsembleIntegrator(posed, 1).integrate(attitudes, joints)
            whole[name].append(middle - start)
            kernels[name].append(time.process_time() - middle)
    for name, found in maps.items():
        exist, motions, count = found.results.exist, found.results.motions, found.motions
        evaluations = motions.evaluations[exist]
        violates = (motions.rates[exist] > RATE).any(axis=1)
        violates |= (motions.upper - motions.lower)[exist].max(axis=1) > 2.0 * RANGE
        print(
            f"{name}: {count} motions, {1e6 * np.median(whole[name]) / count:.1f} us each, "
            f"{1e6 * np.median(kernels[name]) / count:.1f} of them in kernels; "
            f"{evaluations.mean():.0f} evaluations, {evaluations[~violates].mean():.0f} where "
            f"limits are kept, {evaluations[violates].sum() / evaluations.sum():.0%} in the "
            f"{violates.mean():.0%} that violate them"
        )


def mapped(posed: ff.Problem) -> ff.AttitudeMap:
    return ff.attitude_map(posed, ATTITUDES, limits=ff.Limits(joint_rate=RATE), threads=1)


if __name__ == "__main__":
    main()
