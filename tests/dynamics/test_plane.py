"""The plane of planar arms about any direction: compared with Pinocchio alone."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.generalized_jacobian import system_matrix, system_matrix_derivative
from freefloat.dynamics.plane import Plane, plane_of
from freefloat.dynamics.redundancy import Redundancy
from freefloat.dynamics.resolved_rates import ResolvedRateSolver
from tests.motions import X, Z, chain
from tests.planes import DIRECTIONS, planar_arm, turn_to


def free_floating(text: str, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """D and S* (6, n) in the spacecraft frame, by Pinocchio alone."""
    limited = '"revolute"><limit lower="-3" upper="3" effort="1" velocity="1"/>'
    text = text.replace('"continuous">', limited)  # Pinocchio's have cosine and sine
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    data, q = model.createData(), np.concatenate([np.zeros(6), [1.0], joints])
    A = pin.computeCentroidalMap(model, data, q)
    tool = model.getFrameId("tool")
    J = pin.computeFrameJacobian(model, data, q, tool, pin.LOCAL_WORLD_ALIGNED)
    return A[3:, 3:6], J[:, 6:] - J[:, :6] @ np.linalg.solve(A[:, :6], A[:, 6:])


@pytest.mark.parametrize(
    ("joints", "direction"), list(zip(["+-", "+p", "-++", "p+-"], DIRECTIONS, strict=True))
)
def test_measures_are_those_of_pinocchio(joints: str, direction: str) -> None:
    turn = turn_to(direction)
    text = planar_arm(3, joints, turn)
    model = ff.FreeFloatingModel.from_urdf(text, "tool")
    plane = plane_of(model)
    assert plane is not None
    np.testing.assert_allclose(np.abs(plane.normal @ turn[:, 2]), 1.0, atol=1e-12)
    n, q = len(joints), np.array([0.4, -0.3, 0.5])[: len(joints)]
    D, S = free_floating(text, q)
    rows = np.vstack([turn[:, :2].T @ S[:3], turn[:, 2] @ S[3:]])[:n]
    task = "planar-pose" if n == 3 else "planar-position"
    expected = abs(np.linalg.det(rows)), np.linalg.svd(rows)[1][-1]
    gjm, system = (ff.singularity_measure(model, task, name)(q) for name in ("gjm", "system"))
    assert abs(gjm) == pytest.approx(expected[0], rel=1e-9)
    assert abs(system) == pytest.approx(expected[0] * turn[:, 2] @ D @ turn[:, 2], rel=1e-9)


def test_the_derivative_of_the_system_matrix_is_that_of_differences() -> None:
    model = ff.FreeFloatingModel.from_urdf(planar_arm(5, "+-+", turn_to("oblique")), "tool")
    q, rates, step = np.array([0.4, -0.9, 0.5]), np.array([0.3, 0.2, -0.7]), 1e-6
    after, before = (system_matrix(model, q + s * rates, "planar-pose") for s in (step, -step))
    change = system_matrix_derivative(model, q, rates, "planar-pose")
    np.testing.assert_allclose(change, (after - before) / (2.0 * step), atol=1e-7)


@pytest.mark.parametrize("metric", ["joints", "energy"])
@pytest.mark.parametrize("direction", ["x", "oblique"])
def test_rates_of_redundant_arms_are_those_about_z(direction: str, metric: str) -> None:
    """Also toward a high manipulability, whose gradient is in the axes of the plane."""
    turn, q, solved = turn_to(direction), np.array([0.4, -0.9, 0.5, 0.3]), []
    for axes in (np.eye(3), turn):
        model = ff.FreeFloatingModel.from_urdf(planar_arm(7, "+-+-", axes), "tool")
        system = ff.System(model, axes @ [0.0, 0.0, 0.2])
        redundancy = Redundancy(metric=metric, toward="sigma")
        solver = ResolvedRateSolver(system, "planar-position", redundancy)
        attitude = Rotation.from_rotvec(0.7 * axes[:, 2]).as_quat()
        twist = np.concatenate([axes @ [0.02, -0.03, 0.0], np.zeros(3)])
        omega, rates = solver.rates(attitude, q, twist, 0.05)
        solved.append([*(axes.T @ omega), *rates])
    np.testing.assert_allclose(solved[1], solved[0], atol=1e-12)


def test_directions_keep_an_arm_in_a_plane(planar_3dof: ff.FreeFloatingModel) -> None:
    """Revolute along the normal, of either sign, and prismatic across it."""
    text = planar_3dof.description.text

    def plane(axis: str, kind: str = "revolute") -> Plane | None:
        first, rest = text.split('<joint name="q2" type="continuous">')
        changed = rest.replace('<axis xyz="0 0 1"/>', f'<axis xyz="{axis}"/>', 1)
        limit = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
        joint = f'<joint name="q2" type="{kind}">{limit}'
        return plane_of(ff.FreeFloatingModel.from_urdf(first + joint + changed))

    assert None not in (plane("0 0 1"), plane("0 0 -1"), plane("0 1 0", "prismatic"))
    assert plane("0 1 0") is plane("0 1e-6 1") is plane("0 0 1", "prismatic") is None


@pytest.mark.parametrize("count", [1, 2])
def test_arms_with_few_joints_are_told_what_they_would_need(count: int) -> None:
    """Two joints that are not parallel have no task; the error says which arms have one."""
    body = (0.5, 0.0, 0.0), 5.0, (0.3, 0.0, 0.0), (1.0, 1.0, 1.0)
    text = chain(*(("continuous", axis, *body) for axis in (Z, X)[:count]))
    model = ff.FreeFloatingModel.from_urdf(text)
    with pytest.raises(ff.InputError) as caught:
        ff.singularity_measure(model, "position", "gjm")
    assert caught.value.key == "task"
    assert all(task in str(caught.value) for task in ("position", "pointing", "planar-position"))
