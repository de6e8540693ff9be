"""Values of varied keys have their distribution; Sobol indices are SciPy's."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from freefloat.studies.results import StudyResult
from freefloat.studies.sampling import ValuesSection
from freefloat.studies.sensitivity import sensitivities, sobol_indices
from tests.example_studies import SHORT, a_study, finished
from tests.samples import bundled

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


def ishigami(x: np.ndarray) -> np.ndarray:
    """Its first-order indices are 0.3139, 0.4424 and 0, the total ones 0.5576, 0.4424, 0.2437."""
    return np.asarray(np.sin(x[0]) + 7.0 * np.sin(x[1]) ** 2 + 0.1 * x[2] ** 4 * np.sin(x[0]))


def test_indices_are_those_of_scipy_and_intervals_contain_the_known_ones() -> None:
    known = [(0.3139, 0.5576), (0.4424, 0.4424), (0.0, 0.2437)]
    contained = 0
    for seed in range(50):
        A, B = np.random.default_rng(seed).uniform(-np.pi, np.pi, (2, 3, 1024))
        mixed = [np.where(np.arange(3)[:, None] == k, B, A) for k in range(3)]
        values = ishigami(A), ishigami(B), np.array([ishigami(x) for x in mixed])
        indices = sobol_indices(*values)
        contained += sum(
            estimate.low <= value <= estimate.high
            for pair, truth in zip(indices, known, strict=True)
            for estimate, value in zip(pair, truth, strict=True)
        )
    f_A, f_B, f_AB = values
    scipy = stats.sobol_indices(
        func={"f_A": f_A[None], "f_B": f_B[None], "f_AB": f_AB[:, None]}, n=1024
    )
    assert [pair[0].value for pair in indices] == pytest.approx(
        scipy.first_order, rel=0.02, abs=5e-3
    )
    assert [pair[1].value for pair in indices] == pytest.approx(scipy.total_order, rel=0.02)
    assert 0.9 < contained / 300 < 0.99


@pytest.mark.slow
@pytest.mark.usefixtures("kernels")
def test_a_key_without_effect_has_no_index_and_listed_values_have_none(tmp_path: Path) -> None:
    """The margin is kept; the first joint leaves its range, or nearly, if the momentum is large."""
    vary = {"momentum.2": {"uniform": [-1, 1]}, "margin.value": {"uniform": [1, 2]}}
    joint, limit = b'"q1" type="', b'<limit lower="-2.994" upper="3" effort="9" velocity="9"/>'
    text = bundled("planar_3dof")[0].replace(joint + b'continuous">', joint + b'revolute">' + limit)
    (tmp_path / "arm.urdf").write_bytes(text)
    base = SHORT | {"robot": SHORT["robot"] | {"urdf": "arm.urdf"}}
    study = a_study(tmp_path, vary, base=base, cases=20, files="none")
    assert [entry.quantity for entry in sensitivities(study)] == 2 * ["margin"] + 2 * ["feasible"]
    for first, second in np.reshape(sensitivities(study), (2, 2)):
        assert first.first_order.value == pytest.approx(1.0, abs=0.1)
        assert (second.key, second.total.value) == ("margin.value", 0.0)
    base["limits"] = {"joint_torque": 1e6}
    limited = a_study(tmp_path, vary, base=base, cases=20, files="none")
    remark = StudyResult(limited, finished(limited, tmp_path), tmp_path).sensitivity_remark
    assert remark.startswith("no Sobol indices for feasibility: limits")
    listed = a_study(tmp_path, vary | {"timing.duration": {"list": [5, 6]}}, base=SHORT, cases=20)
    assert sensitivities(listed) == []
    masses = {"robot.scale_mass.link_1": {"uniform": [0.9, 1.2]}}
    keys = {"base": SHORT, "cases": 16, "files": "none", "start": {"branch": "best"}}
    assert sensitivities(a_study(tmp_path, masses, **keys)) == []
    masses = {"robot.scale_mass.link_1": {"uniform": [0.9, 30]}}  # many have other arm branches
    assert sensitivities(a_study(tmp_path, masses, **keys | {"start": None})) == []
