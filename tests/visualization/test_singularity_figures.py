"""Colours and curves of figures of the joint space agree with det A of Pinocchio's matrices."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import freefloat as ff
from freefloat.singularities.singularity_map import SingularityMap
from freefloat.visualization.figures.singularity_figures import singularity_figures
from freefloat.visualization.scenes.joint_sections import (
    influential_joints,
    reference_configuration,
)
from tests.motions import bundled
from tests.robots import random_robot

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


@pytest.mark.slow
def test_prismatic_joints_are_shown_over_their_range_in_metres() -> None:
    robot = random_robot(np.random.default_rng(9), "RPRRPR")
    model = ff.FreeFloatingModel.from_urdf(robot.text, robot.end_effector)
    found = ff.singularity_map(model, resolution=np.radians(30.0))
    joints = influential_joints(found, 4)
    axes = next(iter(ff.figures(found).values())).axes[0]
    names = [f"{model.joint_names[k]} [{'m' if model.prismatic[k] else 'deg'}]" for k in joints]
    assert [axes.get_xlabel(), axes.get_ylabel()] == names[:2]
    assert model.prismatic[joints[0]]
    lower, upper = (ends[joints[0]] for ends in model.joint_ranges)
    assert axes.get_xlim() == pytest.approx((lower, upper))


def test_the_most_influential_joints_and_a_regular_configuration() -> None:
    _, found = mapped("spatial_6dof/line")
    assert influential_joints(found, 3) == [1, 2, 4]  # shoulder, elbow and wrist
    values = np.abs(found.polynomial.values(np.random.default_rng(1).uniform(-3.2, 3.2, (999, 6))))
    at = reference_configuration(found)
    assert abs(found.polynomial.values(at[None])[0]) > np.quantile(values, 0.99)
    assert np.degrees(at) % 5.0 == pytest.approx(np.round(np.degrees(at)) % 5.0, abs=1e-9)
