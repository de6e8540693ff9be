"""End-effector paths: pose and tangent belong together; files of samples are read with care."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.paths.curves import ArcCurve, SplineCurve
from freefloat.paths.directed_orientation import DirectedOrientation
from freefloat.paths.samples import parse_samples, samples_text
from tests.differences import assert_close
from tests.errors import error_key

SAMPLES = """x, y, z, qx, qy, qz, qw
0,0,0,0,0,0,1
1,0,0,0,0,0.70710678,0.70710678
1,1,0,0,0,1,0
"""


def read_samples(file):
    return parse_samples(samples_text(file), file)


@pytest.fixture
def write(tmp_path):
    """Writes a file of samples, returns its path."""

    def _write(text, encoding="utf-8"):
        file = tmp_path / "samples.csv"
        file.write_text(text, encoding=encoding)
        return file

    return _write


def test_samples_are_passed_by_chord_length(write):
    curve, attitude = read_samples(write("x,y,z\n0,0,0\n3,0,0\n3,1,0\n"))
    assert attitude is None
    expected = SplineCurve([[0, 0, 0], [3, 0, 0], [3, 1, 0]])
    assert_close(curve.knots, [0.0, 0.75, 1.0])
    for s in (0.1, 0.5, 0.9):
        assert_close(curve(s), expected(s), atol=1e-15)


def test_samples_are_passed_at_their_s(write):
    curve, _ = read_samples(write("s , z,y, x\n0,7,0,0\n0.4,7,0,3\n1,7,1,3\n"))
    assert_close(curve(0.4), [3.0, 0.0, 7.0], atol=1e-14)
    assert curve.knots.tolist() == [0.0, 0.4, 1.0]


def test_samples_with_quaternions_have_an_attitude(write):
    """qx, qy, qz, qw are passed where x, y, z are, scaled to unit length."""
    curve, attitude = read_samples(write(SAMPLES))
    for s, angle in ((0.0, 0.0), (0.5, np.pi / 2), (1.0, np.pi)):
        expected = Rotation.from_rotvec([0, 0, angle]).as_matrix()
        assert_close(attitude.rotation(s), expected, atol=1e-7)
    assert_close(curve(0.5), [1.0, 0.0, 0.0], atol=1e-14)
    ff.EndEffectorPath(curve, attitude)


@pytest.mark.parametrize("text", [
    "",
    "x,y\n0,0\n1,1\n",
    "x,y,z,x\n0,0,0,0\n1,1,1,1\n",
    "x,y,z\n0,0,0\n",
    "x,y,z\n0,0,0\n1,1\n",
    "x,y,z\n0,0,0\n1,nan,1\n",
    "x,y,z,s\n0,0,0,0\n1,0,0,0.6\n1,1,0,0.5\n1,1,1,1\n",
    'x,y,z\n0,0,0\n1,"1,1\n',
])  # fmt: skip
def test_unfit_samples_are_refused_with_their_file(write, text):
    file = write(text)
    with pytest.raises(ff.InputError) as caught:
        read_samples(file)
    assert (caught.value.key, caught.value.source) == ("path.samples", str(file))


def test_a_file_that_is_none_is_refused(tmp_path):
    binary = tmp_path / "binary.csv"
    binary.write_bytes(b"x,y,z\n\xff\xfe\x00")
    for file in (tmp_path / "missing.csv", tmp_path, binary):
        with pytest.raises(ff.InputError) as caught:
            parse_samples(samples_text(file), file)
        assert caught.value.source == str(file)


def test_rows_too_near_for_their_rounding_are_named(write):
    s = np.linspace(0.0, 1.0, 20_001)
    rows = np.round(np.stack([2.0 - s, 0.05 * np.sin(3.0 * s), 0.0 * s], axis=1), 6)
    scenario = {
        "robot": {"urdf": "planar_3dof", "end_effector": "end_effector"},
        "task": "planar-position", "timing": {"duration": 30},
        "path": {"samples": str(write("x,y,z\n" + "\n".join(",".join(map(str, r)) for r in rows)))},
    }  # fmt: skip
    assert error_key(ff.load_scenario(scenario).problem) == "path.samples"


def test_an_orientation_whose_rate_is_not_that_of_its_rotation_is_refused() -> None:
    turning = ff.paths.SlerpOrientation(np.eye(3), np.diag([1.0, -1.0, -1.0]))
    still = type("Still", (type(turning),), {"rate": lambda law, s: np.zeros(3)})
    line = SplineCurve([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    assert error_key(ff.EndEffectorPath, line, still(turning.start, turning.end)) == "orientation"


def test_a_curve_whose_second_derivative_is_not_that_of_its_values_is_refused() -> None:
    class Straightened(ff.paths.PolynomialCurve):
        def __call__(self, s: float | np.ndarray, order: int = 0) -> np.ndarray:
            return super().__call__(s, order) * (order < 2)

    assert error_key(ff.EndEffectorPath, Straightened(np.eye(3))) == "curve"
    s = np.linspace(0.0, 1.0, 10_001)
    rounded = np.round(np.stack([np.cos(s), np.sin(s), s], axis=1), 7)
    ff.EndEffectorPath(SplineCurve(rounded, s))  # its third derivative is large, and jumps


AXES = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()
CURVE = ArcCurve([1.0, 0.2, 0.0], [1.5, 0.2, 0.0], [0.0, 0.2, 1.0], 1.2)


TARGET = np.array([0.5, 0.5, 2.0])


@pytest.mark.parametrize(
    "law",
    [ff.paths.FixedOrientation(AXES), ff.paths.SlerpOrientation(np.eye(3), AXES),
     DirectedOrientation.follow(CURVE, "x", [0.1, 0.0, 1.0]),
     DirectedOrientation.point_at(CURVE, "z", TARGET)],
    ids=["fixed", "slerp", "follow", "point"],
)  # fmt: skip
def test_a_moved_path_is_the_same_one_seen_from_another_frame(law, request):
    path = ff.EndEffectorPath(CURVE, law)
    frame = pin.SE3(pin.exp3(np.array([0.4, 0.9, -0.2])), np.array([0.3, -2.0, 1.0]))
    moved = path.moved(frame)
    for s in (0.0, 0.3, 1.0):
        here, there = path.pose(s), moved.pose(s)
        expected = frame * pin.SE3(here.rotation, here.position)
        assert_close(there.position, expected.translation, atol=1e-12)
        if request.node.callspec.id == "point":  # its roll is settled by inertial axes
            sight = frame.act(TARGET) - there.position
            assert_close(there.rotation[:, 2], sight / np.linalg.norm(sight), atol=1e-12)
            continue
        assert_close(there.rotation, expected.rotation, atol=1e-12)
        turned = np.kron(np.eye(2), frame.rotation) @ path.tangent(s)
        assert_close(moved.tangent(s), turned, atol=1e-12)
