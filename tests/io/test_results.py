"""Results saved to files and loaded as the same class; broken files are errors."""

import json
import os
import shutil
from importlib.metadata import version

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.errors import InputError
from freefloat.io.files import written_beside
from freefloat.io.verified_hdf5 import AlteredFileError
from freefloat.robot.named_files import find_robot
from freefloat.so3 import heading_quaternion
from freefloat.verification.tolerances import differences
from tests.plans import planar_plan
from tests.result_files import altered, replaced, with_digest
from tests.samples import plans

pytestmark = pytest.mark.usefixtures("kernels")


def assert_same_motion(motion, other):
    assert motion.ending is other.ending
    for name in ("times", "attitudes", "joints", "base_positions"):
        assert np.array_equal(getattr(motion, name), getattr(other, name)), name


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A plan of a short motion."""
    path = tmp_path_factory.mktemp("saved") / "plan.h5"
    path.write_bytes(plans()[1])
    return path


def test_plain_hdf5_tools_can_read_it(saved):
    """Only arrays of numbers, texts and attributes with units."""
    with h5py.File(saved) as file:
        kinds = []
        file.visititems(lambda _, item: kinds.append(getattr(item, "dtype", None)))
        assert {str(kind) for kind in kinds if kind is not None} <= {"float64", "int64", "object"}
        assert file["result/chosen/motion/times"].attrs["unit"] == "s"
        assert file["joint_names"].asstr()[()].tolist() == ["q1", "q2", "q3"]
        assert json.loads(file["document"].asstr()[()])["feasible"] is True
        assert file.attrs["software_freefloat"] == version("freefloat")
        assert (file.attrs["format"], file.attrs["version"]) == ("freefloat plan", 4)


CARRIED = """\
robot:
  urdf: robots/arm.urdf
  end_effector: tool0
  scale_mass: {upper_arm_link: 1.1}
  spacecraft: {mass: 200, inertia: [35, 35, 35], size: [1, 1, 1], mount: {xyz: [0, 0, 0.5]}}
  payload: {mass: 5, inertia: [0.1, 0.1, 0.1], com: [0, 0, 0.2]}
task: pose
momentum: [0.05, 0, 0.02]
path: {samples: way.csv}
timing: {duration: 20}
margin: {measure: gjm, fraction: 0.01}
"""


def test_a_problem_without_limits_has_none_when_it_is_loaded(tmp_path):
    line = ff.paths.PolynomialCurve.line([0.9, 0.2, 0.0], [0.6, 0.7, 0.0])
    problem = ff.Problem("planar_2dof", path=line, duration=20, margin=("gjm", 0.05))
    for result in (ff.simulate(problem, heading=0.2), ff.attitude_map(problem, 36)):
        ff.save(result, tmp_path / "result.h5")
        loaded = ff.load(tmp_path / "result.h5")
        assert loaded.problem.limits is None
        assert loaded.to_dict() == result.to_dict()


@pytest.mark.parametrize("objective", ["margin", {"margin": np.float32(1.0), "turn": np.int64(1)}])
def test_a_search_with_numbers_of_numpy_is_saved(objective, tmp_path):
    problem = ff.load_scenario("planar_2dof/line").problem()
    joints = dict(zip(problem.model.joint_names, np.float32([-0.9, 2.1]), strict=True))
    plan = ff.plan(problem, ff.Search(objective, [0.0, 0.0, 0.0, 1.0], joints=joints))
    json.dumps(plan.to_dict())
    ff.save(plan, tmp_path / "result.h5")
    assert ff.load(tmp_path / "result.h5").search.to_dict() == plan.search.to_dict()


@pytest.mark.parametrize("name", ["spatial_6dof/line", "planar_3dof/parabola"])
def test_a_file_has_the_joints_that_the_arm_of_a_problem_starts_near(name, tmp_path):
    problem = ff.load_scenario(name).problem()
    attitude = heading_quaternion(3.0) if problem.has_headings else [0.46, 0.0935, 0.7352, -0.489]
    problem = problem.replace(start_joints=problem.branches(attitude)[0].joints)
    results = (
        ff.plan(problem, ff.Search(samples=64), tolerances=False),
        ff.attitude_map(problem, 64),
    )
    for result in results:
        ff.save(result, tmp_path / "result.h5")
        loaded = ff.load(tmp_path / "result.h5")
        np.testing.assert_array_equal(loaded.problem.start_joints, problem.start_joints)
        assert ff.check(loaded).passed


def test_a_path_of_very_many_samples_in_a_folder_of_any_name_is_saved(tmp_path, monkeypatch):
    folder = tmp_path / os.fsdecode(b"n\xff")  # no UTF-8
    folder.mkdir()
    s = np.linspace(0.0, 1.0, 10_001)[:, None]
    points = np.hstack([1.9 - s, 0.2 + 0.3 * s**2, 0.0 * s])
    np.savetxt(folder / "way.csv", points, "%.17g", ",", header="x,y,z", comments="")
    shutil.copy(find_robot("planar_2dof", folder), folder)
    (folder / "long.yaml").write_text(
        "robot: {urdf: planar_2dof.urdf, end_effector: end_effector}\ntask: planar-position\n"
        "path: {samples: way.csv}\ntiming: {duration: 30}\n"
        "margin: {measure: system, fraction: 0.05}\n"
    )
    found = ff.load_scenario(folder / "long.yaml").simulate(heading=0.3)
    ff.save(found, tmp_path / "motion.h5")
    assert ff.check(ff.load(tmp_path / "motion.h5")).passed


def test_a_path_that_dwells_at_a_sample_is_saved(tmp_path):
    (tmp_path / "way.csv").write_text(
        "s,x,y,z\n0,1.9,0.2,0\n0.4,1.5,0.5,0\n0.6,1.5,0.5,0\n1,0.9,1,0"
    )
    scenario = ff.load_scenario({
        "robot": {"urdf": "planar_2dof", "end_effector": "end_effector"},
        "task": "planar-position", "path": {"samples": str(tmp_path / "way.csv")},
        "timing": {"duration": 30}, "margin": {"measure": "system", "fraction": 0.05},
    })  # fmt: skip
    ff.save(scenario.plan(), tmp_path / "plan.h5")
    assert ff.check(ff.load(tmp_path / "plan.h5")).passed


@pytest.mark.slow
def test_a_file_suffices_when_scenario_robot_and_samples_are_gone(tmp_path, monkeypatch):
    """Masses scaled and bodies mounted once, not twice; mesh paths lead where they led."""
    folder = tmp_path / "there"
    (folder / "robots").mkdir(parents=True)
    shutil.copy(find_robot("example-robot-data:ur5", folder), folder / "robots" / "arm.urdf")
    start = ff.load_scenario("ur5_servicer/arc").problem().path.path
    rows = [[*start.pose(s).position, *Rotation.from_matrix(start.pose(s).rotation).as_quat()]
            for s in (0.0, 0.1, 0.2)]  # fmt: skip
    lines = ["x,y,z,qx,qy,qz,qw", *(",".join(map(repr, map(float, row))) for row in rows)]
    (folder / "way.csv").write_text("\r\n".join(lines))
    (folder / "carried.yaml").write_text(CARRIED)
    monkeypatch.chdir(tmp_path)
    problem = ff.load_scenario("there/carried.yaml").problem()
    simulation = ff.simulate(problem, [0.0, 0.0, 0.0, 1.0])
    ff.save(simulation, "m.h5")
    shutil.rmtree(folder)
    loaded = ff.load("m.h5").chosen.motion
    assert_same_motion(loaded, simulation.chosen.motion)
    assert loaded.problem.model.total_mass == problem.model.total_mass
    assert loaded.problem.model.description.source == str(folder / "robots" / "arm.urdf")
    assert loaded.residuals().end_effector_position < 1e-7


def attribute(name, value, group="/"):
    return lambda file: file[group].attrs.__setitem__(name, value)


MOTION = "result/chosen/motion"
JOINTS = f"{MOTION}/joints"
KINDS = {
    "format": attribute("format", "other"),
    "number": attribute("format", 3),
    "kind": attribute("format", "freefloat other"),
    "future": attribute("version", 99),
    "link": lambda file: file.__setitem__("odd", h5py.SoftLink("/motion")),
    "huge": lambda file: file.create_dataset("odd", (10**9,), "f8"),
    "offset": attribute("offset", 3.0, JOINTS),
}


@pytest.fixture
def refusal(saved, tmp_path):
    """The error for the file with a change, which it names."""

    def load(change):
        path = tmp_path / "changed.h5"
        path.write_bytes(altered(saved.read_bytes(), change))
        with pytest.raises(InputError) as caught:
            ff.load(path)
        assert caught.value.source == str(path)
        return caught.value

    return load


def test_a_segment_without_duration_is_refused(tmp_path):
    path = tmp_path / "plan.h5"
    ff.save(planar_plan(), path)
    change = replaced("result/segments/0/span", lambda span: 0.0 * span)
    path.write_bytes(altered(path.read_bytes(), change))
    with pytest.raises(InputError, match="span"):
        ff.load(path)


SHORTER = [replaced(f"{MOTION}/{name}", lambda values: values[:-1])
           for name in ("times", "attitudes", "joints", "base_positions")]  # fmt: skip
BROKEN = {
    "class": attribute("class", "Capture", "result/chosen"),
    "ending": attribute("ending", "LOST", MOTION),
    "unknown": lambda file: file.create_group(f"{MOTION}/odd"),
    "text": attribute("stretch", "1.0", "result"),
    "panels": lambda file: [change(file) for change in SHORTER],
    "back": replaced(f"{MOTION}/times", lambda t: t[np.argsort(np.sin(t))]),
    "base": replaced(f"{MOTION}/base_positions", lambda p: p + 1e-8),
    "document": replaced("document", lambda _: "[1, 2"),
    "scenario": replaced("scenario", lambda _: "task: dance"),
    "robot": replaced("robot", lambda _: "<robot/>"),
    "end-effector": replaced("end_effector", lambda _: "tool"),  # the joint that moves it
    "number": replaced("samples", lambda _: 3.0),
    "unit": attribute("unit", "deg", JOINTS),
    "further number": lambda file: file.__setitem__("certified_margin", 12.0),
    "nested brackets": replaced("document", lambda _: "[" * 100_000),
}


@pytest.mark.parametrize("change", [*KINDS.values(), *BROKEN.values()], ids=[*KINDS, *BROKEN])
def test_files_of_another_kind_are_refused_and_broken_ones_are_altered(refusal, change):
    assert isinstance(refusal(change), AlteredFileError) is (change in BROKEN.values())


def test_derived_arrays_agree_up_to_rounding(saved, tmp_path):
    path = tmp_path / "rounded.h5"
    change = replaced(f"{MOTION}/base_positions", lambda p: p * (1.0 + 5e-10))
    path.write_bytes(altered(saved.read_bytes(), change))
    assert ff.load(path).to_dict() == ff.load(saved).to_dict()


def restated(*keys, by):
    """A change of a value in the document of a file."""

    def change(text):
        document = json.loads(text)
        place = document
        for key in keys[:-1]:
            place = place[key]
        place[keys[-1]] = by(place[keys[-1]])
        return json.dumps(document)

    return replaced("document", change)


RESTATED = {
    "min_margin.value": restated("min_margin", "value", by=lambda value: 2.0 * value),
    "attitude_ranges_deg[0].ranges[0][1]": restated(
        "attitude_ranges_deg", 0, "ranges", 0, 1, by=lambda high: high - 1.0
    ),
    "feasible": attribute("feasible", False, "result"),
    "duration": replaced("scenario", lambda text: text.replace("duration: 5", "duration: 6")),
}


@pytest.mark.parametrize("key", RESTATED)
def test_a_document_that_contradicts_the_arrays_is_altered(refusal, key):
    error = refusal(RESTATED[key])
    assert isinstance(error, AlteredFileError)
    assert error.key == key
    if key == "feasible":
        assert error.problem.index("True") < error.problem.index("False")


@pytest.mark.parametrize(("stated", "recomputed", "keys"), [
    ({"a": 1.0, "only": 2}, {"a": 1, "other": 3}, []),
    ({"a": {"b": [1.0, 2.0, [4]]}}, {"a": {"b": [1.0, 3.0, [5]]}}, ["a.b[1]", "a.b[2][0]"]),
    ({"a": [1], "b": []}, {"a": [1, 2], "b": {}}, ["a", "b"]),
    ({"attitude": [0.0, 0.6, 0.8]}, {"attitude": [0.0, -0.6, -0.8]}, []),
    ({"text": "a", "a": True, "b": True, "c": None, "d": "1", "e": None},
     {"text": "b", "a": False, "b": 1, "c": 0.0, "d": 1, "e": None}, ["a", "b", "c", "d"]),
    ({"near": 1e6 + 0.9, "far": 1e6 + 1.1}, {"near": 1e6, "far": 1e6}, ["far"]),
    ({"residuals": {"a": [3e-4, 2e-4, 1e-5]}, "b": 3e-4, "residuals_of": 3e-4},
     {"residuals": {"a": [1e-4, 1.9e-5, 1.1e-4]}, "b": 1e-4, "residuals_of": 1e-4},
     ["residuals.a[1]", "residuals.a[2]", "b", "residuals_of"]),
])  # fmt: skip
def test_what_a_document_states_differs_by_more_than_rounding(stated, recomputed, keys):
    """Of attitudes up to their sign, of residuals the order of magnitude; texts do not count."""
    assert [key for key, *_ in differences(stated, recomputed)] == keys
    assert [*differences([1.0], [2.0])] == [("[0]", 1.0, 2.0)]


def test_a_file_is_not_parsed_unless_its_digest_is_right(saved, tmp_path, monkeypatch):
    content = bytearray(saved.read_bytes())
    assert with_digest(bytes(content[512:])) == bytes(content)
    content[len(content) // 2] ^= 1
    (tmp_path / "flipped.h5").write_bytes(content)
    (tmp_path / "cut.h5").write_bytes(saved.read_bytes()[:-4000])
    monkeypatch.setattr(h5py, "File", None)
    for name in ("flipped.h5", "cut.h5"):
        with pytest.raises(AlteredFileError):
            ff.load(tmp_path / name)


def test_files_that_are_no_results_are_refused(tmp_path):
    (tmp_path / "text.h5").write_text("hello")
    (tmp_path / "folder.h5").mkdir()
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1
    for name in ("missing.h5", "folder.h5", "text.h5", "other.h5"):
        with pytest.raises(InputError, match=name):
            ff.load(tmp_path / name)


def test_only_plain_files_are_replaced(saved, tmp_path):
    """A device or a folder stays what it is; a link keeps leading to its file."""
    plan = ff.load(saved)
    elsewhere = tmp_path.with_name(f"{tmp_path.name}_elsewhere")
    (tmp_path / "dangling.h5").symlink_to(elsewhere)
    places = [tmp_path, tmp_path / "no" / "plan.h5", tmp_path / "dangling.h5"]
    for name in ("/dev/full", "", *map(str, places)):
        with pytest.raises(InputError, match="output"):
            ff.save(plan, name)
    assert os.listdir(tmp_path) == ["dangling.h5"]
    assert not elsewhere.exists()
    longest = tmp_path / f"{'x' * 252}.h5"
    ff.save(plan, longest)
    assert longest.is_file()
    (tmp_path / "real.h5").touch()
    (tmp_path / "link.h5").symlink_to(tmp_path / "real.h5")
    ff.save(plan, tmp_path / "link.h5")
    assert (tmp_path / "link.h5").is_symlink()
    assert ff.load(tmp_path / "real.h5").feasible


def test_an_interrupted_writer_leaves_the_old_file_alone(tmp_path):
    target = tmp_path / "plan.h5"
    target.write_text("old")

    def interrupted():
        with written_beside(target) as temporary:
            temporary.write_text("half")
            raise RuntimeError("power cut")

    with pytest.raises(RuntimeError, match="power cut"):
        interrupted()
    assert target.read_text() == "old"
    assert os.listdir(tmp_path) == ["plan.h5"]


def test_what_killed_writers_left_is_removed(tmp_path):
    """Only what was left for the same file, and long ago."""
    names = (".x.h5.a.partial", ".x.h5.b.partial", ".y.h5.c.partial", ".x.h5.notes")
    for name in names:
        (tmp_path / name).touch()
        if name != ".x.h5.b.partial":
            os.utime(tmp_path / name, (0, 0))
    (tmp_path / ".x.h5.d.partial").symlink_to("gone")  # listed, and no file any more
    with written_beside(tmp_path / "x.h5") as temporary:
        temporary.write_text("whole")
    assert set(os.listdir(tmp_path)) == {*names[1:], ".x.h5.d.partial", "x.h5"}
