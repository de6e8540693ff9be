"""Between key times motions may be drawn straight."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from freefloat.io.scenario import load_scenario
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.simulation import simulate
from freefloat.visualization.body_poses import body_poses
from freefloat.visualization.key_frames import key_times


@pytest.fixture(scope="module")
def singular() -> Motion:
    problem = load_scenario("spatial_6dof/line").problem()
    return simulate(problem, [0.1, 0.5, 0.2, -0.8367], branch=2).chosen.motion


def between(motion: Motion, keys: np.ndarray, times: np.ndarray) -> tuple[float, float]:
    """Largest errors of positions [m] and attitudes [rad] drawn straight between keys."""

    def poses(at: np.ndarray):  # type: ignore[no-untyped-def]
        _, attitudes, joints = motion.evaluate(motion.parameter_at(at))
        return body_poses(motion.problem.model, attitudes, joints)

    known, wanted = poses(keys), poses(times)
    away, turn = 0.0, 0.0
    for body in range(known.positions.shape[1]):
        drawn = np.column_stack(
            [np.interp(times, keys, known.positions[:, body, axis]) for axis in range(3)]
        )
        away = max(away, np.linalg.norm(drawn - wanted.positions[:, body], axis=1).max())
        turns = Slerp(keys, Rotation.from_matrix(known.rotations[:, body]))(times)
        off = turns.inv() * Rotation.from_matrix(wanted.rotations[:, body])
        turn = max(turn, off.magnitude().max())
    return away, turn


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5, 5e-7])
def test_what_lies_between_is_as_near_as_asked(
    singular: Motion, rng: np.random.Generator, tolerance: float
) -> None:
    keys = key_times(singular, tolerance)
    times = np.sort(rng.uniform(0.0, singular.times[-1] - 1e-3, 3000))
    away, turn = between(singular, keys, times)
    assert away < 1.5 * tolerance
    assert turn < 15.0 * tolerance


def test_more_precision_costs_more_keys(singular: Motion) -> None:
    counts = [len(key_times(singular, tolerance)) for tolerance in (1e-3, 1e-5, 1e-7)]
    assert counts == sorted(counts)
    assert counts[-1] > 5 * counts[0]


def test_keys_span_the_motion_in_order(singular: Motion) -> None:
    keys = key_times(singular)
    assert keys[0] == singular.times[0]
    assert keys[-1] == singular.times[-1]
    assert (np.diff(keys) > 0.0).all()


def test_there_are_not_more_than_allowed(singular: Motion) -> None:
    assert len(key_times(singular, 1e-12, most=1000)) <= 1000


def test_a_motion_that_ends_where_it_begins_has_one_key(singular: Motion) -> None:
    alone = Motion(singular.problem, Ending.SINGULAR, singular.times[:1], singular.attitudes[:1],
                   singular.joints[:1])  # fmt: skip
    assert key_times(alone).tolist() == [0.0]
