"""Sobol indices: those of SciPy, and of a function whose indices are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from freefloat.studies.results import StudyResult
from freefloat.studies.sensitivity import sensitivities, sobol_indices
from tests.example_studies import SHORT, a_study, finished
from tests.samples import bundled


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
