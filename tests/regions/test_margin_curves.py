"""The closed forms of singularity and margin curves, compared with Pinocchio's det A."""

import numpy as np
import pytest
from scipy.optimize import minimize

import freefloat as ff
from freefloat.regions.margin_curves import TwoAngleDeterminant, level_curves
from freefloat.regions.planar_regions import PlanarArm
from freefloat.regions.workspace import workspace_regions
from tests.planes import planar_arm


def random_arm(seed: int) -> ff.FreeFloatingModel:
    """Two joints about +z or -z, centres of mass anywhere."""
    signs = ("++", "+-", "-+", "--")[seed % 4]
    return ff.FreeFloatingModel.from_urdf(planar_arm(seed, signs, np.eye(3)), "tool")


def determinants(model: ff.FreeFloatingModel, joints: np.ndarray) -> np.ndarray:
    """The determinant of (5) at joints (K, 2), by Pinocchio's matrices."""
    measure = ff.singularity_measure(model, ff.Task.PLANAR_POSITION, "system")
    return np.array([measure(q) for q in joints])


@pytest.mark.slow
def test_k0_k1_and_k2_give_the_determinant_of_any_arm() -> None:
    rng = np.random.default_rng(48)
    for seed in range(50):
        model = random_arm(seed)
        arm = PlanarArm.of(model)
        joints = rng.uniform(-np.pi, np.pi, (20, 2))
        angles = (arm.signs * joints).T
        k0, k1, k2 = (S := TwoAngleDeterminant.of(arm)).k(angles[0])
        closed = np.prod(arm.signs) * (k0 + k1 * np.sin(angles[1]) + k2 * np.cos(angles[1]))
        scale = np.abs(S.coefficients).sum()
        assert closed == pytest.approx(determinants(model, joints), rel=0, abs=1e-13 * scale)


def test_k0_k1_and_k2_are_those_of_appendix_b(planar_3dof: ff.FreeFloatingModel) -> None:
    """(48) to (50) for an arm whose centres of mass lie on its links; a_ij is ``inertia``."""
    arm, q1 = PlanarArm.of(planar_3dof), np.linspace(-3.0, 3.0, 25)
    (a, b, c, _), d = arm.links.real, arm.inertia.real
    s, s2, c1, c2 = np.sin(q1), np.sin(2 * q1), np.cos(q1), np.cos(2 * q1)
    k0, k1, k2 = TwoAngleDeterminant.of(arm).k(q1)
    assert k0 == pytest.approx((2 * a * b * d[2, 2] - c * (a * d[2, 1] + b * d[0, 2])) * s / 2)
    assert k1 == pytest.approx(
        -(a * b * d[0, 2] + a * c * d[0, 1] - 2 * b * c * d[0, 0]) / 2
        + c * (-a * d[1, 1] + b * d[0, 1]) * c1 + a * (b * d[0, 2] - c * d[0, 1]) * c2 / 2
    )  # fmt: skip
    assert k2 == pytest.approx(
        a * (b * d[2, 1] - c * d[1, 1]) * s + a * (b * d[0, 2] - c * d[0, 1]) * s2 / 2
    )


def crossings(S: TwoAngleDeterminant, q1: np.ndarray, level: float) -> np.ndarray:
    """Number of q2 with S = S0 at each q1, by the roots of S - S0 as a polynomial of exp(i q2)."""
    q2 = np.arange(8) * (np.pi / 4)
    waves = np.fft.fft(S(q1[:, None], q2) - level, axis=1, norm="forward")
    low, mean, high = waves[:, 7], waves[:, 0], waves[:, 1]
    root = np.sqrt(mean**2 - 4.0 * high * low)
    sizes = np.abs((np.array([[1], [-1]]) * root - mean) / (2.0 * high))
    return (np.abs(sizes - 1.0) < 1e-9).sum(axis=0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_no_curve_is_missed_and_all_points_lie_on_them(seed: int) -> None:
    """Levels of both signs, zero, and curves around the largest S down to 1e-6 rad wide."""
    rng = np.random.default_rng([22, seed])
    arm = PlanarArm.of(random_arm(seed))
    sign, S = float(np.prod(arm.signs)), TwoAngleDeterminant.of(arm)
    starts = rng.uniform(-np.pi, np.pi, (12, 2))
    tops = [minimize(lambda q: -float(S(*q)), q, tol=1e-15, method="Nelder-Mead") for q in starts]
    top = min(tops, key=lambda found: found.fun)
    largest, at = -top.fun, top.x
    step = 1e-4
    bend = (2.0 * largest - S(at[0] + step, at[1]) - S(at[0] - step, at[1])) / step**2
    for level in (0.0, 0.3 * largest, -0.2 * largest, largest - bend * 1e-6**2, 0.99 * largest):
        curves = level_curves(arm, sign * level)
        wide = sum(np.ptp(curve.joints[:, 0]) for curve in curves if curve.first)
        assert wide > 1e-6
        q1 = np.linspace(-np.pi, np.pi, 10_001)[:-1] + 1e-9
        ends = [np.sort(arm.signs[0] * curve.joints[[0, -1], 0]) for curve in curves]
        counted = np.zeros(len(q1), int)
        for low, high in ends:
            counted += (q1 - low) % (2 * np.pi) < high - low
        assert (counted == crossings(S, q1, level)).all()
        for curve in curves:
            q = arm.signs * curve.joints
            assert np.abs(S(*q.T) - level).max() < 1e-12 * np.abs(S.coefficients).sum()
            assert curve.covered[0] <= curve.radii.min() <= curve.radii.max() <= curve.covered[1]


def test_the_areas_are_those_of_the_curves_of_figure_2() -> None:
    """Of the arm 40/4/3; its second joint is singular at -11.4108 and 171.44254 deg at -65."""
    model = ff.load_scenario("planar_2dof/line").problem().model
    curves = {curve.name: curve for curve in level_curves(PlanarArm.of(model), 0.0)}
    assert set(curves) == {"I", "II"}
    regions = workspace_regions(ff.load_scenario("planar_2dof/line").problem())
    covered = sorted(curve.covered for curve in curves.values())
    assert np.ravel(regions.path_dependent) == pytest.approx(np.ravel(covered))
