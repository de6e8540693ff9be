"""Values of varied keys: listed values are exact, random values have their distribution."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from freefloat.studies.sampling import ValuesSection

COUNT = 2000
UNIFORM = 0.7775237034301146
BALL = np.array([[-0.5647510078635776, -0.24913519562608685, -0.22542271567393066]])
UNLIKELY = 1e-4
"""Probability below which a sample is not of its distribution."""


def section(**keys: Any) -> ValuesSection:
    return ValuesSection.model_validate(keys)


def sample(count: int = COUNT, seed: int = 3, key: str = "key", **keys: Any) -> np.ndarray:
    return section(**keys).draws(seed, key, 0, count)


@pytest.mark.parametrize(("keys", "values"), [
    ({"list": [1, [2, 3], "a"]}, [1, [2, 3], "a"]),
    ({"range": [0, 1, 0.1]}, [k / 10 for k in range(11)]),
    ({"range": [-0.3, 0.3, 0.1]}, [-0.3, -0.2, -0.1, 0, 0.1, 0.2, 0.3]),
    ({"range": [0, np.pi, np.pi / 2]}, [0, np.pi / 2, np.pi]),
    ({"range": [5, 5, 1]}, [5]),
    ({"range": [8, 32, 8]}, [8, 16, 24, 32]),
    ({"grid": {"from": 0, "to": 1, "count": 11}}, [k / 10 for k in range(11)]),
    ({"grid": {"from": 2, "to": 9, "count": 1}}, [2.0]),
    (
        {"grid": {"from": [0, 1], "to": [1, 1], "count": [3, 2]}},
        [[0.0, 1.0], [0.0, 1.0], [0.5, 1.0], [0.5, 1.0], [1.0, 1.0], [1.0, 1.0]],
    ),
])  # fmt: skip
def test_listed_values_have_no_rounding_errors(keys: dict[str, Any], values: list[Any]) -> None:
    listed = section(**keys).listed()
    assert listed == values
    assert all(isinstance(value, int) for value in listed) or keys != {"range": [8, 32, 8]}


@pytest.mark.parametrize("keys", [
    {"uniform": [0, 1]},
    {"normal": {"mean": [1, 2, 3, 4, 5], "sd": 2}},
    {"ball": {"center": [0, 0, 0], "radius": 1}},
    {"so3": {}},
])  # fmt: skip
def test_a_value_depends_on_seed_key_and_number_alone(keys: dict[str, Any]) -> None:
    draws = section(**keys).draws
    every = draws(1, "a", 0, 100)
    assert np.array_equal(draws(1, "a", 37, 20), every[37:57])
    assert np.array_equal(draws(1, "a", 99, 1), every[99:])
    others = [draws(2, "a", 0, 100), draws(1, "b", 0, 100), every[1:]]
    assert not any((other[:99] == every[:99]).any() for other in others)


def test_values_never_change_from_version_to_version() -> None:
    """A study that is continued after an upgrade has the same runs."""
    uniform = section(uniform=[0, 1]).draws(7, "momentum", 0, 1)
    ball = section(ball={"center": [0, 0, 0], "radius": 1}).draws(7, "momentum", 199, 1)
    assert uniform == pytest.approx(UNIFORM, abs=1e-15)
    assert ball == pytest.approx(BALL, abs=1e-15)


def test_uniform_values_are_uniform() -> None:
    assert stats.kstest(sample(uniform=[-2, 6]), "uniform", (-2, 8)).pvalue > UNLIKELY
    pairs = sample(uniform=[[0, 10], [1, 30]])
    assert stats.kstest(pairs[:, 1], "uniform", (10, 20)).pvalue > UNLIKELY
    assert abs(np.corrcoef(pairs.T)[0, 1]) < 0.1


def test_normal_values_are_normal() -> None:
    standard = (sample(normal={"mean": 3, "sd": 2}) - 3.0) / 2.0
    assert stats.kstest(standard, "norm").pvalue > UNLIKELY
    pairs = sample(normal={"mean": [1, 5], "sd": [0.1, 4]})
    assert stats.kstest((pairs[:, 1] - 5.0) / 4.0, "norm").pvalue > UNLIKELY
    assert sample(normal={"mean": [1, 2, 3], "sd": 0.5}).shape == (COUNT, 3)


@pytest.mark.parametrize(
    "section",
    [
        {"uniform": [[0.05, 0.06, 0.07], [0.2, 0.25, 0.3]]},
        {"uniform": [[0.05, 0, 0, 0.06, 0, 0.07], [0.2, 0.1, 0.1, 0.25, 0.1, 0.3]]},
        {"normal": {"mean": [0.1, 0.1, 0.1], "sd": 0.05}},
        {"ball": {"center": [0.1, 0.1, 0.1], "radius": 0.09}},
    ],
)
def test_inertias_are_those_of_rigid_bodies(section: dict[str, Any]) -> None:
    """Integrals of squares are positive: half the trace less each moment. Others stay as drawn."""
    section = ValuesSection.model_validate(section)
    plain = section.draws(1, "robot.payload.com", 0, COUNT)
    for key in ("robot.payload.inertia", "robot.spacecraft.inertia"):
        drawn = section.draws(1, key, 0, COUNT)
        moments = drawn if drawn.shape[1] == 3 else np.array([
            np.linalg.eigvalsh([[a, b, c], [b, d, e], [c, e, f]]) for a, b, c, d, e, f in drawn
        ])  # fmt: skip
        integrals = moments.sum(axis=1, keepdims=True) / 2.0 - moments
        assert integrals.min() > -1e-9
        assert moments.min() > 0.0
        again = section.draws(1, key, 17, 1)  # of one run alone
        assert again.tolist() == drawn[17:18].tolist()
    assert plain.shape == drawn.shape


def test_uniform_inertias_are_uniform_over_those_within_the_bounds() -> None:
    """Compared with SciPy's uniform numbers, of which those that are no inertia are left out."""
    low, high = [0.05, 0.06, 0.07], [0.2, 0.25, 0.3]
    section = ValuesSection.model_validate({"uniform": [low, high]})
    drawn = section.draws(1, "robot.payload.inertia", 0, COUNT)
    others = stats.uniform.rvs(low, np.subtract(high, low), (20 * COUNT, 3), random_state=2)
    others = others[2.0 * others.max(axis=1) <= others.sum(axis=1)]
    for mine, theirs in zip(drawn.T, others.T, strict=True):
        assert stats.ks_2samp(mine, theirs).pvalue > UNLIKELY


def test_points_fill_a_ball_evenly() -> None:
    """The fraction within a radius is its cube, and no direction is preferred."""
    points = (sample(ball={"center": [1, 2, 3], "radius": 4}) - [1, 2, 3]) / 4.0
    lengths = np.linalg.norm(points, axis=1)
    assert stats.kstest(lengths**3, "uniform").pvalue > UNLIKELY
    for axis in (points / lengths[:, None]).T:
        assert stats.kstest(axis, "uniform", (-1, 2)).pvalue > UNLIKELY


def test_attitudes_fill_so3_evenly() -> None:
    """The angle of a random rotation has the density (1 - cos) / pi."""
    rotations = Rotation.from_quat(sample(so3={}))
    angles = rotations.magnitude()
    assert stats.kstest((angles - np.sin(angles)) / np.pi, "uniform").pvalue > UNLIKELY
    assert stats.kstest(rotations.apply([0, 0, 1])[:, 2], "uniform", (-1, 2)).pvalue > UNLIKELY


def test_attitudes_stay_within_the_angle_of_their_centre() -> None:
    centre = Rotation.from_rotvec([0.4, -1.0, 0.2])
    quaternions = sample(so3={"center": centre.as_quat().tolist(), "angle_deg": 30.0})
    angles = (Rotation.from_quat(quaternions) * centre.inv()).magnitude()
    assert angles.max() <= np.radians(30.0) + 1e-12
    volume = (angles - np.sin(angles)) / (np.radians(30.0) - 0.5)
    assert stats.kstest(volume, "uniform").pvalue > UNLIKELY
