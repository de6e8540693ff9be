"""Colours and curves of figures of the joint space agree with det A of Pinocchio's matrices."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import freefloat as ff
from freefloat.beyond.joint_space.figures import reference_configuration, singularity_figures
from freefloat.beyond.joint_space.singularity_map import SingularityMap
from tests.motions import bundled

RESOLUTIONS = {"planar_3dof/parabola": 1.0, "spatial_6dof/line": 8.0}


@cache
def mapped(name: str) -> tuple[ff.Problem, SingularityMap]:
    problem = bundled(name)
    return problem, ff.singularity_map(problem.model, problem.task, np.radians(RESOLUTIONS[name]))


@pytest.mark.slow
@pytest.mark.parametrize("name", RESOLUTIONS)
def test_curves_and_colours_agree_with_the_determinant(name: str) -> None:
    problem, found = mapped(name)
    measure = ff.singularity_measure(problem.model, problem.task, "system")
    at = reference_configuration(found)
    largest = abs(measure(at))
    (figure,) = singularity_figures(found).values()
    pairs = [(a, b) for a in found.joints for b in found.joints if a < b]
    assert len(figure.axes) == len(pairs)
    for axes, pair in zip(figure.axes, pairs, strict=True):

        def determinant(degrees: np.ndarray, pair: tuple[int, int] = pair) -> float:
            q = at.copy()
            q[list(pair)] = np.radians(degrees)
            return float(measure(q))

        for path in axes.collections[0].get_paths():
            vertices = path.vertices[:: max(1, len(path.vertices) // 50)]
            assert max(map(abs, map(determinant, vertices))) < 1e-3 * largest
        classes = np.asarray(axes.images[0].get_array())
        rows, columns = np.random.default_rng(2).integers(0, len(classes), (2, 300))
        for row, column in zip(rows, columns, strict=True):
            centre = np.array([column, row]) + 0.5 - 180.0  # a cell has one degree
            if classes[row, column] < 2:
                assert np.sign(determinant(centre)) == (1.0, -1.0)[classes[row, column]]
        assert axes.get_xlabel() == f"{found.model.joint_names[pair[0]]} [deg]"
