"""Reach and areas: published radii, brute force in joint space, and what the paper says."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq, minimize

import freefloat as ff
from tests.motions import bundled
from tests.robots import planar_robot


def collinear(masses, moments, mount, centres, lengths):
    """A planar arm from its table: distance of the mount, joint to centre of mass, link lengths."""
    after = [mount, *(length - centre for length, centre in zip(lengths, centres, strict=True))]
    return ff.FreeFloatingModel.from_urdf(planar_robot(masses, moments, centres, after))


def problem_of(model):
    task = ff.Task.PLANAR_POSE if model.dof == 3 else ff.Task.PLANAR_POSITION
    return ff.Problem(
        model, path=bundled("planar_3dof/parabola_nonstop").path, task=task, margin=("system", 0.0)
    )


PAPADOPOULOS_2R = ([40, 4, 3], [6.667, 0.333, 0.25], 0.5, [0.5, 0.5], [1.0, 1.0])
CEPHEUS_3R = (
    [13, 0.06, 0.106, 0.08], [0.1196, 2e-4, 2.7e-4, 3.7e-5], 0.1746,
    [0.181004, 0.1605, 0.0499], [0.262704, 0.20436, 0.0639],
)  # fmt: skip
CBK_3R = (
    [64.859, 2.913, 2.646, 1.699], [2.6952, 0.091391, 0.081375, 0.021904], 0.3696,
    [0.1805, 0.2, 0.1029], [0.4488, 0.4499, 0.3545],
)  # fmt: skip


@pytest.mark.parametrize(("table", "areas"), [
    (PAPADOPOULOS_2R, [(0.35106, 0.55368), (1.43617, 2.28723)]),
    (CEPHEUS_3R, [(0.11500, 0.22771), (0.28868, 0.63139)]),
    pytest.param(CBK_3R, [(0.31491, 0.38111), (0.51403, 1.17883)], marks=pytest.mark.slow),
])  # fmt: skip
def test_path_dependent_areas_have_the_published_radii(table, areas):
    """Annuli that S = 0 sweeps, computed elsewhere from the authors' own closed form."""
    workspace = ff.workspace_regions(problem_of(collinear(*table)))
    assert np.array(workspace.path_dependent) == pytest.approx(np.array(areas), abs=2e-5)
    folded, stretched = areas  # where (22a) and (22b) are singular
    assert (workspace.area_a, workspace.area_b) == (
        (pytest.approx(folded, abs=2e-5),), (pytest.approx(stretched, abs=2e-5),)
    )  # fmt: skip
    if table is PAPADOPOULOS_2R:  # an inner disc can be path-independent
        assert workspace.reach[0] == 0.0
        assert workspace.path_independent[0] == pytest.approx((0.0, 0.35106), abs=2e-5)


def test_areas_of_example_1_fill_the_reach_and_its_path_crosses_both(planar):
    """Point 3 passes the inner area once and the outer one at the end; F lies in neither."""
    workspace = ff.workspace_regions(planar)
    areas = sorted([*workspace.path_dependent, *workspace.path_independent])
    assert areas[0][0] == pytest.approx(workspace.reach[0], abs=1e-6)
    assert areas[-1][1] == pytest.approx(workspace.reach[1], abs=1e-6)
    for (_, high), (low, _) in pairwise(areas):
        assert high == pytest.approx(low)
    assert workspace.largest_s == pytest.approx(148.6277, abs=1e-3)
    parts = workspace.path
    assert [inside for _, inside in parts] == [False, True, False, True]
    assert parts[2][0][0] < 0.8333 < parts[2][0][1]


@pytest.fixture(scope="module")
def shells(spatial):
    """Reach and areas of Example 2."""
    return ff.workspace_regions(spatial)


def singular_joints(problem, name, rng, lines):
    """Joints at which a measure changes its sign along random lines through joint space."""
    measure, roots = ff.singularity_measure(problem.model, problem.task, name), []
    for _ in range(lines):
        start, way = rng.uniform(-np.pi, np.pi, (2, problem.model.dof))

        def along(t: float, start: np.ndarray = start, way: np.ndarray = way):
            return measure(start + t * way)

        steps = np.linspace(0.0, 3.0, 40)
        for low, high in pairwise(steps):
            if along(low) * along(high) < 0.0:
                roots.append(start + brentq(along, low, high, xtol=1e-13) * way)
    return np.array(roots)


def distances(problem, workspace, joints):
    """Of the workspace's point from the centre of mass, by Pinocchio."""
    poses = [problem.model.end_effector_pose([0, 0, 0, 1], q) for q in joints]
    return np.array([np.linalg.norm(p.position + p.rotation @ workspace.offset) for p in poses])


def test_areas_of_an_asymmetric_arm_end_at_extrema_along_its_singularity_curves(rng):
    """Extreme distances where S = 0, by constrained optimization; the rim is one of them."""
    payload = ff.Payload(5.0, [1.0, 1.0, 1.0], com=[0.1, 0.3, 0.0])
    problem = problem_of(ff.FreeFloatingModel.from_urdf("planar_2dof", payload=payload))
    workspace = ff.workspace_regions(problem)
    singular = singular_joints(problem, "system", rng, 60)
    radii = distances(problem, workspace, singular)
    condition = {"type": "eq", "fun": problem.margin.measure}
    for sign, edge in zip([1.0, -1.0] * 2, np.ravel(workspace.path_dependent), strict=True):
        found = minimize(
            lambda q, sign=sign: sign * distances(problem, workspace, [q])[0],
            singular[np.abs(radii - edge).argmin()], method="SLSQP", constraints=condition,
            options={"ftol": 1e-15},
        )  # fmt: skip
        assert sign * found.fun == pytest.approx(edge, abs=1e-9)
    assert workspace.path_independent[-1][1] < 0.9 * workspace.reach[1]


@pytest.mark.slow
def test_singular_configurations_fill_the_path_dependent_shells(spatial, shells, rng):
    radii = np.sort(distances(spatial, shells, singular_joints(spatial, "arm", rng, 200)))
    assert len(radii) > 250
    assert shells.path_dependent is not None
    for low, high in shells.path_dependent:
        inside = radii[(radii > low - 1e-5) & (radii < high + 1e-5)]
        filled = np.concatenate([[low], inside, [high]])
        assert np.diff(filled).max() < 0.1 * (high - low)
        radii = np.setdiff1d(radii, inside)
    assert len(radii) == 0


def test_the_path_of_example_2_crosses_one_path_dependent_area(shells):
    """As the paper says of point 3; its singular point C and touch point lie in it."""
    assert shells.point == "virtual wrist centre"
    parts = shells.path
    assert [inside for _, inside in parts] == [False, True, False]
    low, high = parts[1][0]
    ends, singular = np.array([[1, 0, 0], [-0.5, 0.8, 0.33]]), np.array([0.1214, 0.4686, 0.1943])
    s = (singular - ends[0]) @ (ends[1] - ends[0]) / np.sum((ends[1] - ends[0]) ** 2)
    assert low < s < high
