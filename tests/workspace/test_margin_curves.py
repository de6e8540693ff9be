"""Margin curves in joint space, and the areas they sweep round the centre of mass."""

import json
from itertools import pairwise

import numpy as np
import pytest
from typer.testing import CliRunner

import freefloat as ff
from freefloat.cli.app import app
from freefloat.dynamics.measures import singularity_measure
from freefloat.errors import InputError
from freefloat.motion.problem import Margin, Problem
from freefloat.workspace.margin_curves import (
    complement,
    margin_curves,
    merged,
    most_singular_place,
    path_areas,
    planar_workspace,
)
from freefloat.workspace.planar_arm import PlanarArm


def collinear(masses, moments, mount, centres, lengths):
    """A planar arm from its table: distance of the mount, joint to centre of mass, link lengths."""
    text, at = ['<robot name="arm">'], [mount, *lengths]
    for i, (mass, moment) in enumerate(zip(masses, moments, strict=True)):
        centre = centres[i - 1] if i else 0.0
        text.append(
            f'<link name="l{i}"><inertial><origin xyz="{centre} 0 0"/><mass value="{mass}"/>'
            f'<inertia ixx="{moment}" ixy="0" ixz="0" iyy="{moment}" iyz="0" izz="{moment}"/>'
            "</inertial></link>"
        )
        if i:
            text.append(
                f'<joint name="q{i}" type="continuous"><parent link="l{i - 1}"/>'
                f'<child link="l{i}"/><origin xyz="{at[i - 1]} 0 0"/><axis xyz="0 0 1"/></joint>'
            )
    n = len(masses) - 1
    text.append(
        f'<link name="tip"/><joint name="t" type="fixed"><parent link="l{n}"/><child link="tip"/>'
        f'<origin xyz="{at[n]} 0 0"/></joint></robot>'
    )
    return ff.FreeFloatingModel.from_urdf("".join(text), "tip")


def problem_of(model):
    task = ff.Task.PLANAR_POSE if model.dof == 3 else ff.Task.PLANAR_POSITION
    path = ff.load_scenario("planar_3dof/parabola_nonstop").problem().path
    return Problem(
        model, path, task, [0, 0, 0], Margin(singularity_measure(model, task, "system"), 0.0)
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


@pytest.mark.parametrize(
    ("table", "areas"),
    [
        (PAPADOPOULOS_2R, [(0.35106, 0.55368), (1.43617, 2.28723)]),
        (CEPHEUS_3R, [(0.11500, 0.22771), (0.28868, 0.63139)]),
        (CBK_3R, [(0.31491, 0.38111), (0.51403, 1.17883)]),
    ],
)
def test_path_dependent_areas_have_the_published_radii(table, areas):
    """Annuli that S = 0 sweeps, computed elsewhere from the authors' own closed form."""
    workspace = planar_workspace(problem_of(collinear(*table)))
    assert np.array(workspace.path_dependent) == pytest.approx(np.array(areas), abs=2e-5)


def test_areas_and_reach_fill_each_other():
    """What is not path-dependent is path-independent, and nothing lies beyond the reach."""
    workspace = planar_workspace(ff.load_scenario("planar_3dof/parabola").problem())
    pieces = sorted([*workspace.path_dependent, *workspace.path_independent])
    assert pieces[0][0] == pytest.approx(workspace.reach[0], abs=1e-6)
    assert pieces[-1][1] == pytest.approx(workspace.reach[1], abs=1e-6)
    for (_, high), (low, _) in pairwise(pieces):
        assert high == pytest.approx(low)
    assert workspace.largest_s == pytest.approx(148.6277, abs=1e-3)


def test_an_inner_disc_can_be_path_independent():
    """Between the least reach and the inner area of the 2R arm nothing is ever singular."""
    workspace = planar_workspace(problem_of(collinear(*PAPADOPOULOS_2R)))
    inner = workspace.path_independent[0]
    assert workspace.reach[0] == 0.0
    assert inner == pytest.approx((0.0, 0.35106), abs=2e-5)


@pytest.mark.parametrize("level", [0.0, 5.0, -60.0])
def test_margin_curves_satisfy_22a_and_22b(level):
    """On a curve q2 is one of the two closed forms, with k0, k1, k2 read off S at three angles."""
    model = ff.load_scenario("planar_3dof/parabola").model()
    S = singularity_measure(model, ff.Task.PLANAR_POSE, "system")
    curves = margin_curves(PlanarArm.of(model), level)
    assert curves
    for curve in curves:
        for q1, q2 in curve.joints[:: max(1, len(curve.joints) // 15)]:
            at_0, at_90, at_180 = (S(np.array([q1, q, 0.0])) for q in (0.0, np.pi / 2, np.pi))
            k0, k2 = (at_0 + at_180) / 2, (at_0 - at_180) / 2
            k1 = at_90 - k0
            height = np.clip((level - k0) / np.hypot(k1, k2), -1.0, 1.0)
            shift = np.arctan2(k2, k1)
            forms = np.array([np.pi - np.arcsin(height) - shift, np.arcsin(height) - shift])
            assert np.abs(np.angle(np.exp(1j * (forms - q2)))).min() < 2e-5


def test_the_path_of_example_1_crosses_both_areas():
    """Point 3 passes the inner area once and the outer one at the end; F lies in neither."""
    problem = ff.load_scenario("planar_3dof/parabola").problem()
    parts = path_areas(problem, planar_workspace(problem))
    assert [inside for _, inside in parts] == [False, True, False, True]
    assert parts[2][0][0] < 0.8333 < parts[2][0][1]


def test_largest_s_at_the_worst_place_of_the_path_is_that_of_a_fine_search():
    """No configuration with point 3 at that distance has a larger |S|."""
    problem = ff.load_scenario("planar_3dof/parabola").problem()
    s, largest = most_singular_place(problem)
    arm = PlanarArm.of(problem.model)
    rng = np.random.default_rng(0)
    q = rng.uniform(-np.pi, np.pi, (400_000, 2))
    angles = arm.angles(np.zeros(len(q)), np.column_stack([q, np.zeros(len(q))]))
    radii = np.abs(arm.vectors(angles)[:, :3].sum(axis=1))
    from freefloat.workspace.margin_curves import point_3_on_path

    near = np.abs(radii - abs(point_3_on_path(problem, s))) < 0.005
    assert largest == pytest.approx(np.abs(arm.determinant(angles[near])).max(), rel=0.05)


def test_arms_whose_s_depends_on_more_angles_are_refused():
    """A spatial arm has no areas that planar formulas could tell."""
    with pytest.raises(InputError, match="planar-position with two turning joints"):
        planar_workspace(ff.load_scenario("spatial_6dof/line").problem())


def test_intervals_merge_and_complement():
    """Set algebra on a line."""
    assert merged([(3.0, 4.0), (0.0, 1.0), (0.5, 2.0)]) == ((0.0, 2.0), (3.0, 4.0))
    assert complement(((0.0, 2.0), (3.0, 4.0)), (0.0, 5.0)) == ((2.0, 3.0), (4.0, 5.0))


def workspace_command(*words):
    """What the command answers to these words."""
    result = CliRunner().invoke(app, ["workspace", *words])
    assert result.exit_code == 0, result.output
    return result.stdout


def test_the_workspace_command_tells_reach_and_areas():
    """Keys of the contract."""
    document = json.loads(workspace_command("planar_3dof/parabola", "--json"))
    assert document["reach"] == pytest.approx([0.39278, 3.17410], abs=1e-5)
    assert len(document["pdw"]) == 2
    assert len(document["piw"]) == 1


def test_the_workspace_command_answers_in_space():
    """Shells about the arm factor in Example 2; the path crosses one of them."""
    told = json.loads(workspace_command("spatial_6dof/line", "--json"))
    assert (told["point"], told["measure"], told["exact"]) == ("wrist centre", "arm", True)
    assert len(told["pdw"]) == len(told["piw"]) == 2
    assert [part["path_dependent"] for part in told["path"]] == [False, True, False]
    assert "shoulder and wrist can become singular" in workspace_command("spatial_6dof/line")


def test_the_workspace_command_tells_what_it_does_not_know():
    """Of a redundant arm the reach alone."""
    told = json.loads(workspace_command("panda_servicer/line", "--json"))
    assert (told["pdw"], told["piw"], told["path"]) == (None, None, [])
    assert told["reach"][1] == pytest.approx(1.5721, abs=1e-3)
