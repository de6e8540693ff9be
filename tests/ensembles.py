"""Motions integrated both singly and as an ensemble, for comparison."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.ensemble.endings import COMPLETED, MARGIN, SINGULAR
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ensemble.result import EnsembleResult
from freefloat.motion.motion import Ending, Motion
from freefloat.so3 import angle_between, heading_quaternion

CODES = {Ending.COMPLETED: COMPLETED, Ending.SINGULAR: SINGULAR, Ending.MARGIN: MARGIN}
FINE = 1e-8
"""Tolerance at which only systematic errors remain."""


def states(problem: ff.Problem, attitudes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Every arm branch at every attitude: attitudes (K, 4) and joints (K, n)."""
    sets = problem.many_branches(np.atleast_2d(attitudes))
    where, _ = np.nonzero(sets.exist)
    return np.atleast_2d(attitudes)[where], sets.joints[sets.exist]


def headings(*degrees: float) -> np.ndarray:
    return heading_quaternion(np.deg2rad(degrees))


def random_attitudes(count: int, seed: int) -> np.ndarray:
    return Rotation.random(count, rng=np.random.default_rng(seed)).as_quat()


def dense(motion: Motion, count: int = 3000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, attitudes and joints all along a motion."""
    return motion.evaluate(np.linspace(0.0, motion.panels, count))


def joint_rates(motion: Motion, count: int = 400) -> np.ndarray:
    """Largest magnitudes of the joint rates on a dense sample in time."""
    problem = motion.problem
    solver = problem.resolved_rate_solver()
    rows = zip(*dense(motion, count), strict=True)
    return np.abs([
        solver.rates(attitude, joints, problem.path.twist(float(t)))[1]
        for t, attitude, joints in rows
    ]).max(axis=0)  # fmt: skip


@dataclass
class Case:
    """A motion by single integration, and by the ensemble at two tolerances."""

    motion: Motion
    coarse: EnsembleResult
    fine: EnsembleResult
    k: int

    def assert_same(self) -> None:
        """All results of a motion.

        Near a singularity relative errors of the measure are large: errors are compared with its
        initial value.
        """
        motion, k = self.motion, self.k
        measure = motion.problem.margin.measure
        approach, first = ff.closest_approach(motion, measure), abs(measure(motion.joints[0]))
        for result, error in ((self.coarse, 3e-4), (self.fine, 1e-5)):
            assert result.endings[k] == CODES[motion.ending]
            late = abs(result.ended_at[k] - motion.final.time) / motion.problem.path.duration
            if motion.ending is Ending.SINGULAR:
                assert late < (1e-4 if result is self.coarse else 2e-6)
                assert result.minimum[k] == 0.0
                assert result.minimum_at[k] == result.ended_at[k]
                continue
            assert late == 0.0
            assert result.minimum[k] == pytest.approx(
                approach.value, rel=max(10 * error, 2e-4), abs=error * first
            )
            assert angle_between(result.attitudes[k], motion.final.attitude) < error
            np.testing.assert_allclose(
                result.joints[k], motion.final.joints, rtol=0, atol=2 * error
            )
            there = motion.sample([result.minimum_at[k]])[0].joints
            assert abs(measure(there)) == pytest.approx(approach.value, rel=2e-3, abs=error * first)

    def assert_same_extent(self) -> None:
        """Largest rates and ranges, compared with those at some instants."""
        rates, (_, _, joints) = joint_rates(self.motion), dense(self.motion)
        low, high = joints.min(axis=0), joints.max(axis=0)
        quick, width, k = float(rates.max()), float((high - low).max()), self.k
        for result, fraction in ((self.coarse, 5e-3), (self.fine, 2e-3)):
            np.testing.assert_allclose(
                result.rates[k], rates, rtol=fraction, atol=0.3 * fraction * quick
            )
            np.testing.assert_allclose(result.lower[k], low, rtol=0, atol=0.6 * fraction * width)
            np.testing.assert_allclose(result.upper[k], high, rtol=0, atol=0.6 * fraction * width)
            assert (result.rates[k] <= rates + 0.005 * quick).all()
            assert (result.lower[k] >= low - 1e-3 * width).all()
            assert (result.upper[k] <= high + 1e-3 * width).all()


def both(problem: ff.Problem, attitudes: np.ndarray, joints: np.ndarray) -> list[Case]:
    """Integrate every state by both methods."""
    coarse, fine = (
        EnsembleIntegrator(problem, 1, tolerance=tolerance).integrate(
            attitudes, joints, extremes=True
        )
        for tolerance in (1e-6, FINE)
    )
    motions = [
        ff.integrate_motion(problem, *state) for state in zip(attitudes, joints, strict=True)
    ]
    return [Case(motion, coarse, fine, k) for k, motion in enumerate(motions)]
