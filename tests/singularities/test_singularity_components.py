"""Components of the joint space agree with a flood fill of det A, and hold the arm branches."""

import numpy as np
import pytest
from scipy.ndimage import label

import freefloat as ff
from freefloat.beyond.joint_space.components import singularity_components
from tests.motions import bundled


@pytest.mark.slow
@pytest.mark.parametrize("name", ["planar_2dof/line", "planar_3dof/parabola"])
def test_components_are_those_of_a_flood_fill(name: str) -> None:
    problem = bundled(name)
    found = singularity_components(ff.singularity_map(problem.model, problem.task))
    measure = ff.singularity_measure(problem.model, problem.task, "system")
    axis = np.radians(np.arange(-180.0, 180.0, 3.0))
    q = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
    joints = np.concatenate([q, np.zeros((len(q), problem.model.dof - 2))], axis=1)
    positive = np.array([measure(row) > 0.0 for row in joints]).reshape(120, 120)
    regions = 0
    for sign, mask in ((1, positive), (-1, ~positive)):
        numbers, count = label(mask)
        same = {(a, b) for a, b in zip(numbers[0], numbers[-1], strict=True) if a and b}
        same |= {(a, b) for a, b in zip(numbers[:, 0], numbers[:, -1], strict=True) if a and b}
        joined = list(range(count + 1))
        for a, b in same:
            joined = [joined[a] if n == joined[b] else n for n in joined]
        regions += len(set(joined[1:]))
        volume = sum(part.volume for part in found.components if part.sign == sign)
        assert volume == pytest.approx(mask.mean(), abs=0.02)
    assert len(found.components) == regions
    inside = found.at(joints)
    signs = np.array([part.sign for part in found.components])
    known = inside >= 0
    assert known.mean() > 0.99
    assert (signs[inside[known]] == np.where(positive.ravel()[known], 1, -1)).all()


@pytest.mark.slow
def test_the_components_of_an_elbow_arm_correspond_to_its_branches() -> None:
    problem = bundled("spatial_6dof/line")
    found = singularity_components(ff.singularity_map(problem.model, problem.task, np.radians(2.0)))
    assert len(found.components) == 8
    assert sum(part.sign for part in found.components) == 0
    most = [max(part.branches, key=lambda name: part.branches[name]) for part in found.components]
    assert len(set(most)) == 8
