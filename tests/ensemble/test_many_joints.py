"""Compiled motions of arms with few and with very many joints agree with single integration.

The minimum is two joints, for a planar position.
"""

from dataclasses import replace

import numpy as np
import pytest

import freefloat as ff
from freefloat.dynamics.redundancy import Metric, Toward
from freefloat.ensemble.endings import COMPLETED, MARGIN, SINGULAR
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.motion.motion import Ending
from tests.ensembles import both, states
from tests.lock_step import plain_kernels
from tests.motions import from_here
from tests.redundant import choices, redundant

FEWEST = [
    ("2", ff.Task.PLANAR_POSITION), ("3", ff.Task.PLANAR_POSE), ("RPR", ff.Task.POSITION),
    ("RRRPRR", ff.Task.POSE),
]  # fmt: skip
TEN = [("10", ff.Task.PLANAR_POSE), ("RRPRRRRCRR", ff.Task.POSE)]
THIRTY = [("30", ff.Task.PLANAR_POSE), ("RRRRRRRPRRCRRRR" * 2, ff.Task.POSE)]
"""Structures, or the number of planar joints, and tasks, as for ``redundant``."""


def with_measure(problem, name):
    return replace(
        problem, margin=ff.Margin(ff.singularity_measure(problem.model, problem.task, name), 0.0)
    )


def starts_of(start, count):
    """The start, and some of the arm branches at its attitude."""
    attitudes, joints = states(start.problem, start.attitude)
    chosen = np.linspace(0, len(joints) - 1, min(count, len(joints))).astype(int)
    return (
        np.vstack([start.attitude, attitudes[chosen]]), np.vstack([start.joints, joints[chosen]]),
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("structure", "task", "redundancy"), [
    *((*arm, None) for arm in (*FEWEST, *TEN, *THIRTY)),
    *((*arm, choices(*arm, 1)[number]) for arm, number in zip(TEN, (1, 8), strict=True)),
    (*THIRTY[0], ff.Redundancy(Metric.ENERGY, Toward.MANIPULABILITY, 0.8, 2.0)),
    (*THIRTY[1], ff.Redundancy(Metric.ENERGY, Toward.MIDDLE, 0.8, 2.0)),
])  # fmt: skip
def test_motions_agree_with_single_integration(structure, task, redundancy):
    """Every motion precise; at least one completed."""
    start = redundant(structure, task, redundancy, 1)
    cases = both(start.problem, *starts_of(start, 1))
    for case in cases:
        case.assert_same()
    assert any(case.motion.completed for case in cases)


@pytest.mark.slow
@pytest.mark.parametrize(("structure", "task"), [TEN[0], THIRTY[0]])
def test_endings_beyond_the_reach(structure, task):
    """Where a straight arm is singular; before that, where a margin is violated."""
    start = redundant(structure, task, None, 1)
    model, away = start.problem.model, [2.0 * len(start.joints), 0.0, 0.0]
    problem = from_here(
        model, task, [0.0, 0.0, 0.3], start.attitude, start.joints, away, [0, 0, 0.1],
        ff.Timing(30.0),
    )  # fmt: skip
    (case,) = both(problem, start.attitude[None], start.joints[None])
    case.assert_same()
    assert case.fine.endings[0] == SINGULAR
    level = 0.3 * problem.margin.measure(start.joints)
    bounded = replace(problem, margin=ff.Margin(problem.margin.measure, level))
    exact = ff.integrate_motion(bounded, start.attitude, start.joints, stop_at_margin=True)
    stopped = EnsembleIntegrator(problem, 1).integrate(
        start.attitude[None], start.joints[None], stop_below=level
    )
    assert exact.ending is Ending.MARGIN
    assert stopped.endings[0] == MARGIN
    assert 0.0 <= stopped.ended_at[0] - exact.final.time < 0.5  # at the end of a step
    assert stopped.minimum[0] < level


def begin(problem, start):
    """The first steps of a motion."""
    integrator = EnsembleIntegrator(problem, 1, tolerance=1e-3)
    return integrator.integrate(start.attitude[None], start.joints[None], ends=np.array([2.0]))


@pytest.mark.slow
@pytest.mark.parametrize(("structure", "task", "redundancies"), [
    (*FEWEST[1], [None]),  # others run in plain Python below
    *(
        (*arm, choices(*arm, 1)[::4])
        for arm in (("RPRR", ff.Task.POSITION), ("4", ff.Task.PLANAR_POSE))
    ),
    *((*arm, [None, ff.Redundancy(Metric.ENERGY, Toward.MIDDLE)]) for arm in TEN),
])  # fmt: skip
def test_kernels_stay_within_their_tables(structure, task, redundancies):
    for redundancy in redundancies:
        start = redundant(structure, task, redundancy, 1)
        for name in ("gjm", "sigma") if redundancy is None else ("gjm",):
            with plain_kernels():
                assert begin(with_measure(start.problem, name), start).evaluations[0] > 6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("structure", "task", "number", "seed"),
    [("RPR", ff.Task.POSITION, None, 1), ("RRRRRR", ff.Task.POSE, None, 6),
     ("4", ff.Task.PLANAR_POSE, 5, 1)],
)  # fmt: skip
def test_plain_and_compiled_kernels_agree(structure, task, number, seed):
    """Square, prismatic, planar and redundant arms, over the whole path."""
    redundancy = None if number is None else choices(structure, task, seed)[number]
    start = redundant(structure, task, redundancy, seed)
    integrator = EnsembleIntegrator(start.problem, 1)
    state = start.attitude[None], start.joints[None]
    compiled = integrator.integrate(*state)
    with plain_kernels():
        plain = integrator.integrate(*state)
    assert compiled.endings[0] == plain.endings[0] == COMPLETED
    for name in ("ended_at", "minimum", "attitudes", "joints", "rates", "determinant_ratios"):
        np.testing.assert_allclose(
            getattr(plain, name), getattr(compiled, name), rtol=1e-9, atol=1e-9, err_msg=name
        )
