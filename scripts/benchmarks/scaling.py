"""How the time grows with samples and joints, and shrinks with cores."""

from __future__ import annotations

import os

import numpy as np

import freefloat as ff
from benchmarks.arm import arm_urdf
from benchmarks.result import Result, race
from freefloat.attitude_grids import attitude_grid
from freefloat.dynamics.measures import singularity_measure
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.orientation import FixedOrientation
from freefloat.planning.space.map_sampling import sample_attitudes

SAMPLES = (1024, 4096, 16_384)
JOINTS = range(3, 9)
POSE = 6
"""Minimum number of joints for which the end-effector's orientation is prescribed, too."""


def with_samples(quick: bool) -> list[Result]:
    evaluator = FeasibilityEvaluator(ff.load_scenario("spatial_6dof/line").problem())
    sample_attitudes(evaluator, 64)
    sizes = SAMPLES if not quick else (16, 64)
    seconds = race(
        *(lambda size=size: sample_attitudes(evaluator, size) for size in sizes),
        rounds=1 if quick else 2,
    )
    return [
        Result(f"an attitude of a map of {size:,}", taken / size)
        for size, taken in zip(sizes, seconds, strict=True)
    ]


def line_problem(joints: int) -> ff.Problem:
    """A straight line of 0.4 m in 60 s for an arm of so many joints."""
    model = ff.FreeFloatingModel.from_urdf(arm_urdf(joints), f"link_{joints}")
    task = ff.Task.POSE if joints >= POSE else ff.Task.POSITION
    curve = PolynomialCurve.line([1.0, 0.0, 0.0], [1.0, 0.3, 0.25])
    path = ff.EndEffectorPath(curve, FixedOrientation(np.eye(3)))
    margin = ff.Margin(singularity_measure(model, task, "gjm"), 0.0)
    return ff.Problem(model, ff.TimedPath(path, ff.Timing(60.0)), task, np.zeros(3), margin)


def with_joints(quick: bool) -> list[Result]:
    """The same end-effector motion from random states, which need not be on the path for that.

    As in a search each is given up where its measure falls to a margin, a hundredth of the usual.
    """
    count, rng = 16 if quick else 1024, np.random.default_rng(5)
    runs, names = [], []
    for joints in JOINTS if not quick else (3, 6):
        problem = line_problem(joints)
        integrator = EnsembleIntegrator(problem)
        starts, attitudes = rng.uniform(-1.5, 1.5, (count, joints)), attitude_grid(count)
        usual = np.median(np.abs([problem.margin.measure(q) for q in starts]))
        integrator.integrate(attitudes[:1], starts[:1])
        runs.append(
            lambda r=integrator, a=attitudes, s=starts, m=0.01 * usual: r.integrate(
                a, s, stop_below=m
            )
        )
        rows = 6 if joints >= POSE else 3
        names.append(f"one motion of an ensemble, {joints} joints, {rows} task coordinates")
    seconds = race(*runs, rounds=1 if quick else 5)
    return [Result(name, taken / count) for name, taken in zip(names, seconds, strict=True)]


def with_cores(quick: bool) -> list[Result]:
    problem = ff.load_scenario("spatial_6dof/line").problem()
    count, cores = 32 if quick else 4096, len(os.sched_getaffinity(0))
    attitudes = attitude_grid(count // 8)
    branches = problem.many_branches(attitudes)
    where, _ = np.nonzero(branches.exist)
    starts, joints = attitudes[where], branches.joints[branches.exist]
    integrators = [EnsembleIntegrator(problem, threads) for threads in (cores, 1)]
    all_, single = race(
        *(
            lambda integrator=integrator: integrator.integrate(starts, joints)
            for integrator in integrators
        ),
        rounds=1 if quick else 5,
    )
    return [Result(f"{len(joints):,} motions on {cores} cores", all_, "on one core", single)]


def scaling_results(quick: bool) -> list[Result]:
    return [*with_samples(quick), *with_joints(quick), *with_cores(quick)]
