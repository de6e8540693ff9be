"""Models of MuJoCo: bases, sites, capsules, and what of them is not used."""

import itertools
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

import freefloat as ff
from freefloat.robot.parts import Attachment
from tests.commands import document, error, run
from tests.errors import error_key
from tests.robots import assert_as_pinocchio_reads

pytestmark = pytest.mark.usefixtures("readers_here")
ARM = """<body name="upper" pos="0.5 0 0" euler="10 20 30">
  <joint name="q1" axis="0 0 1" pos="0.1 0 0" range="-180 180"/>
  <geom type="capsule" size="0.05 0.3" pos="0.3 0 0" euler="0 90 0" mass="5"/>
  <body name="lower" pos="0.6 0 0"><joint name="q2" axis="0 1 0" range="-180 180"/>
    <geom type="capsule" fromto="0 0 0 0.5 0 0" size="0.04" mass="4"/>
    <body name="hand" pos="0.5 0 0"><joint name="q3" axis="0 1 0" range="-180 180"/>
      <geom size="0.1" mass="2"/>{more}
    </body></body></body>"""
BUS = '<geom name="box" type="box" size="0.5 0.5 0.5" mass="200" {box}/>'


def written(folder: Path, root: str = "<freejoint/>", more: str = "", *, head: str = "",
            tail: str = "", before: str = "", box: str = "") -> Path:  # fmt: skip
    """A file with a bus that joints carry, an arm of three joints, and more in its last body."""
    bus = f'<body name="bus">{root}{BUS.format(box=box)}{ARM.format(more=more)}</body>'
    file = folder / "robot.xml"
    file.write_text(f"<mujoco>{head}<worldbody>{before}{bus}</worldbody>{tail}</mujoco>")
    return file


def assert_placed(model: ff.FreeFloatingModel, joints: np.ndarray, element: object) -> None:
    """The end-effector is where MuJoCo has a body or site of a robot at the origin."""
    still = [0.0, 0.0, 0.0, 1.0]
    pose = model.end_effector_pose(still, joints)
    away = pose.position - model.base_position(still, joints)
    np.testing.assert_allclose(away, element.xpos, atol=1e-12)
    np.testing.assert_allclose(pose.rotation.ravel(), element.xmat, atol=1e-12)


def assert_same_jacobians(*models: ff.FreeFloatingModel, task: str = "position") -> None:
    """Two robots have the same S*, to the last bit."""
    q = [0.3, -0.7, 0.5][: models[0].dof]
    np.testing.assert_array_equal(*(ff.generalized_jacobian(model, q, task) for model in models))


SLIDES = [f'<joint name="{name}" type="slide" axis="{axis}"/>'
          for name, axis in (("x", "1 0 0"), ("y", "0 1 0"), ("z", "0 0 1"))]  # fmt: skip
HINGES = [text.replace("slide", "hinge").replace('name="', 'name="r') for text in SLIDES]
BASES = {
    "upright plane": [SLIDES[0], SLIDES[2], HINGES[1]],
    "planar with a range": [*SLIDES[:2], HINGES[2].replace("/>", ' range="-1 1"/>')],
    "a hinge": HINGES[:1],
    "two slides": SLIDES[:2],
    "a ball": ['<joint name="b" type="ball"/>'],
    "parallel slides": [*SLIDES[:2], SLIDES[0].replace('"x"', '"z"'), *HINGES],
    "six with a range": [*SLIDES[:2], SLIDES[2].replace("/>", ' range="-1 0.9"/>'), *HINGES],
}


@pytest.mark.parametrize("name", BASES)
def test_bases_that_are_not_free_are_refused_by_name(name: str, tmp_path: Path) -> None:
    file = written(tmp_path, "".join(BASES[name]))
    refusal = error("info", file, "--end-effector", "hand")
    assert refusal["key"] == "root"
    names = [text.split('"')[1] for text in BASES[name]]
    assert all(f"{joint} (" in refusal["message"] for joint in names)
    for root in ("bus", "lower"):
        source = ff.RobotSource(file, root)
        assert error_key(ff.FreeFloatingModel.from_urdf, source, "hand") == "root"


@pytest.mark.parametrize("root", [
    "", "<freejoint/>", '<joint type="free"/>', "".join([*SLIDES, *HINGES]),
    "".join([*SLIDES, '<joint type="ball"/>']),
])  # fmt: skip
def test_free_bases_are_the_same_robot(root: str, tmp_path: Path) -> None:
    model = ff.FreeFloatingModel.from_urdf(written(tmp_path, root), "hand")
    assert (model.body_names[0], model.joint_names) == ("bus", ("q1", "q2", "q3"))
    assert model.total_mass == pytest.approx(211.0)


def test_a_base_in_the_plane_of_its_arm_is_as_good_as_free(tmp_path: Path) -> None:
    """Two slides and a hinge about y; heavier beside the plane, the robot would tilt."""
    links = (
        '<body name="upper" pos="0.25 0 0"><joint name="q1" axis="0 1 0"/>{upper}'
        '<body name="fore" pos="0.4 0 0"><joint name="q2" axis="0 1 0"/>{fore}'
        '<site name="tip" pos="0.4 0 0"/></body></body>'
    )
    part = '<geom type="box" size="0.2 0.02 0.02" pos="0.2 {} 0" mass="1.5"/>'
    flat = links.format(upper=part.format(0), fore=part.format(0))
    bus = '<body name="bus">{}<geom type="box" size="0.25 0.25 0.2" mass="80"/>{}</body>'
    file, base = tmp_path / "planar.xml", "".join([SLIDES[0], SLIDES[2], HINGES[1]])

    def loaded(joints: str, arm: str) -> ff.FreeFloatingModel:
        file.write_text(f"<mujoco><worldbody>{bus.format(joints, arm)}</worldbody></mujoco>")
        return ff.FreeFloatingModel.from_urdf(file, "tip")

    for sign in (1, -1):
        arm = flat.replace('axis="0 1 0"', f'axis="0 {sign} 0"')
        models = (loaded(joints, arm) for joints in (base, "<freejoint/>"))
        assert_same_jacobians(*models, task="planar-position")
    for arm in (flat.replace("0.2 0 0", "0.2 0.1 0", 1), flat.replace("0 1 0", "1 0 0")):
        assert error_key(loaded, base, arm) == "root"


def test_two_slides_and_a_hinge_about_z_are_a_planar_base(tmp_path: Path) -> None:
    for order in itertools.permutations([*SLIDES[:2], HINGES[2]]):
        file = written(tmp_path, "".join(order))
        model = ff.FreeFloatingModel.from_urdf(file, "hand")
        assert (model.base, model.joint_names) == ("planar", ("q1", "q2", "q3"))
        free = ff.FreeFloatingModel.from_urdf(written(tmp_path), "hand", base="planar")
        assert_same_jacobians(model, free)


FIXED = """<body name="post"><body name="plate"/></body><body name="target" mocap="true"/>
<site name="there" pos="0 0 2"/>"""
CLIENT = '<body name="client"><freejoint/><geom size="1"/></body>'
SITED = '<freejoint/><site name="here"/>'
CABLE = '<tendon><spatial name="c" {}><site site="there"/><site site="here"/></spatial></tendon>'
ROPE = """<deformable><flex name="rope" dim="1" body="bus {}" vertex="0 0 0 0 0 0" element="0 1"
radius="0.01"/></deformable>"""
EQUAL = "<equality>{}</equality>"
TIES = [
    *(EQUAL.format(tie) for tie in (
        '<weld body1="bus"/>', '<connect body1="bus" body2="world" anchor="0 0 0"/>',
        '<weld site1="here" site2="there"/>', '<weld body1="bus" body2="post"/>',
        '<weld body1="plate" body2="hand"/>',
        '<connect body1="lower" body2="world" anchor="0 0 0"/>',
        '<connect body1="hand" body2="target" anchor="0 0 0"/>',
    )),
    *(CABLE.format(force) for force in (
        'stiffness="10"', 'limited="true" range="0 2"', 'frictionloss="1"',
    )),
    CABLE.format("") + EQUAL.format('<tendon tendon1="c"/>'), ROPE.format("world"),
]  # fmt: skip
"""What ties a base or an arm to what is fixed."""
FORCELESS = [
    EQUAL.format('<weld active="false" body1="bus"/>'), CABLE.format(""),
    CABLE.format("") + EQUAL.format('<tendon tendon1="c" active="false"/>'), ROPE.format("hand"),
    EQUAL.format('<weld body1="bus" body2="hand"/>'),
    EQUAL.format('<weld body1="client" body2="hand"/>'),
    EQUAL.format('<joint joint1="q1" polycoef="0.4 0 0 0 0"/>'),
]  # fmt: skip
"""Ties without force, and ties to what floats."""


COUPLED = EQUAL.format('<joint joint1="z"/>')
"""Of a joint that carries the bus."""


@pytest.mark.parametrize("tie", [*TIES, *FORCELESS, COUPLED])
def test_robots_that_are_tied_to_what_is_fixed_are_refused(tie: str, tmp_path: Path) -> None:
    root = "".join([*SLIDES, *HINGES]) if tie is COUPLED else SITED
    file = written(tmp_path, root, before=FIXED + CLIENT, tail=tie)
    source = ff.RobotSource(file, "bus")
    if tie not in FORCELESS:
        assert error_key(ff.FreeFloatingModel.from_urdf, source, "hand") == "root"
    else:
        model = ff.FreeFloatingModel.from_urdf(source, "hand")
        assert model.joint_names == ("q1", "q2", "q3")


@pytest.mark.parametrize("around", ["{}", '<body name="frame" euler="0 0 40">{}</body>'])
def test_bases_on_massless_carriages_float_on_a_table(around: str, tmp_path: Path) -> None:
    """With ranges as wide as a table, which are listed; heavy carriages would not."""
    arm = written(tmp_path, HINGES[2].replace("/>", ' range="-400 400"/>')).read_text()
    start, _, rest = arm.partition('<body name="bus">')
    slides = [slide.replace("/>", ' range="-1.5 1.5"/>') for slide in SLIDES[:2]]

    def loaded(mass: float) -> ff.FreeFloatingModel:
        light = f'<inertial pos="0 0 0" mass="{mass}" diaginertia="1e-9 1e-9 1e-9"/>'
        carriages = "".join(f'<body name="c{number}">{slide}{light}'
                            for number, slide in enumerate(slides))  # fmt: skip
        bus = f'{carriages}<body name="bus">{rest.partition("</worldbody>")[0]}</body></body>'
        file = tmp_path / "carriages.xml"
        file.write_text(f"{start}{around.format(bus)}</worldbody></mujoco>")
        return ff.FreeFloatingModel.from_urdf(file, "hand")

    model = loaded(1e-6)
    free = ff.FreeFloatingModel.from_urdf(written(tmp_path), "hand", base="planar")
    assert_same_jacobians(model, free)
    assert (model.base, model.body_names[0]) == ("planar", "bus")
    listed = {(entry.element, entry.attribute) for entry in model.not_read}
    assert {(f"joint {name}", "range") for name in ("x", "y", "rz")} <= listed
    assert any(entry.meaning == "it is left out" for entry in model.not_read)
    if around == "{}":
        assert error_key(loaded, 1.0) == "root"


def test_bodies_with_several_joints_and_arms_in_the_world(tmp_path: Path) -> None:
    """Poses are MuJoCo's; the world carries what stands in it, and is replaced by a spacecraft."""
    geom = '<geom size="0.1" pos="0.1 0.2 0" mass="2"/>'
    file = tmp_path / "arm.xml"
    file.write_text(f"""<mujoco><compiler angle="radian"/><worldbody><geom size="1"/>
      <body name="arm" pos="0.1 0 0.3" euler="0.2 0.4 0.1">{geom}
        <joint name="a" axis="0 0 1" pos="0.1 0 0" ref="0.3" range="0.1 1"/>
        <joint name="b" type="slide" axis="1 0 1" ref="-0.2"/>
        <joint name="c" axis="0 1 0" pos="0 0.2 0.1"/>
        <body name="hand" pos="0.5 0 0.1" euler="0 0 1"><joint name="d" axis="1 0 0"/>{geom}</body>
      </body><body name="client" pos="3 0 0"><freejoint/>{geom}</body></worldbody></mujoco>""")
    assert "--root world" in error("info", file)["accepted"]
    craft = ff.Spacecraft(100.0, [9.0, 8.0, 7.0])
    model = ff.FreeFloatingModel.from_urdf(ff.RobotSource(file, "world"), "hand", spacecraft=craft)
    assert (model.joint_names, model.total_mass) == (("a", "b", "c", "d"), pytest.approx(104.0))
    assert np.array(model.joint_ranges)[:, 0].tolist() == [0.1, 1.0]
    assert not any("no mass" in entry.problem for entry in model.warnings)
    robot = mujoco.MjModel.from_xml_path(str(file))
    state = mujoco.MjData(robot)
    for joints in np.random.default_rng(0).uniform(-2.0, 2.0, (3, 4)):
        state.qpos[:4] = joints
        mujoco.mj_kinematics(robot, state)
        assert_placed(model, joints, state.body("hand"))


def test_what_mujoco_accepts_need_not_be_xml(tmp_path: Path) -> None:
    file = written(tmp_path)
    file.write_text(file.read_text().replace('mass="5"', 'mass="5"solref="0.1 1"'))
    assert ff.FreeFloatingModel.from_urdf(file, "hand").dof == 3


SITES = {
    "tip": 'class="tip" pos="0.1 0.2 0.3"',
    "quat": 'pos="0 0 1" quat="1 2 -1 0.5"',
    "angles": 'euler="40 -20 70"',
    "axis": 'axisangle="1 0 1 25"',
    "axes": 'xyaxes="0 1 0 -1 0 0.2"',
    "z": 'zaxis="1 1 0.3"',
    "line": 'type="capsule" size="0.01" fromto="0 0 0 0.1 0.2 0.3"',
}


def test_sites_are_end_effectors_where_mujoco_has_them(tmp_path: Path) -> None:
    sites = "".join(f'<site name="{name}" {pose}/>' for name, pose in SITES.items())
    head = '<default><default class="tip"><site euler="5 30 20"/></default></default>'
    nested = f'<site/><body name="flange" pos="0.1 0 0.1" euler="0 50 0">{sites}</body>'
    file = written(tmp_path, more=nested, head=head)
    robot = mujoco.MjModel.from_xml_path(str(file))
    state = mujoco.MjData(robot)
    models = {name: ff.FreeFloatingModel.from_urdf(file, name) for name in SITES}
    for joints in np.random.default_rng(0).uniform(-2.0, 2.0, (5, 3)):
        state.qpos[7:] = joints
        mujoco.mj_kinematics(robot, state)
        for name, model in models.items():
            assert_placed(model, joints, state.site(name))


def test_sites_are_offered_and_bodies_stay_the_default(tmp_path: Path) -> None:
    file = written(tmp_path, more='<site name="tip" pos="0 0 1"/><site name="imu"/>')
    assert document("info", file)["end_effector"] == "hand"
    assert {"tip", "imu"} <= set(
        error("info", file, "--end-effector", "tap")["accepted"].split(", ")
    )
    payload = ff.Payload(5.0, np.eye(3))
    held = ff.FreeFloatingModel.from_urdf(file, payload=payload)
    assert held.description.parent_joints["payload"].parent == "hand"
    tool = Attachment(file, "end_effector", prefix="tool_")
    longer = ff.FreeFloatingModel.from_urdf("planar_2dof", attached=[tool])
    assert longer.end_effector == "tool_hand"


def test_a_site_with_the_name_of_a_body_has_another(tmp_path: Path) -> None:
    file = written(tmp_path, more='<site name="hand" pos="0 0 1"/><site name="hand_site"/>')
    info = document("info", file, "--end-effector", "hand")
    assert any("hand_site" in finding["problem"] for finding in info["findings"])
    reach = {name: document("info", file, "--end-effector", name)["barycentric_lengths"][-1]
             for name in ("hand", "hand_site", "hand_site_site")}  # fmt: skip
    assert reach["hand_site"] == pytest.approx(reach["hand"])
    assert reach["hand_site_site"] == pytest.approx(reach["hand"] + 1.0)


def test_written_robots_keep_sites(tmp_path: Path, rng: np.random.Generator) -> None:
    file = written(tmp_path, more='<site name="tip" pos="0.1 0.2 0.3" euler="0 40 0"/>')
    assert run("assemble", file, "-o", tmp_path / "robot.urdf").exit_code == 0
    model, still = ff.FreeFloatingModel.from_urdf(file, "tip"), [0.0, 0.0, 0.0, 1.0]
    assert_as_pinocchio_reads(model, tmp_path / "robot.urdf", rng)
    pose = model.end_effector_pose(still, [0.3, -0.4, 0.8])
    line = ff.paths.PolynomialCurve.line(pose.position, 0.98 * pose.position)
    problem = ff.Problem(model, path=line, duration=60, margin=("gjm", 1e-4))
    ff.save(ff.simulate(problem, still), tmp_path / "motion.h5")
    loaded = ff.load(tmp_path / "motion.h5")
    assert loaded.problem.model.end_effector == "tip"
    assert ff.check(loaded).passed


def test_capsules_stay_capsules(tmp_path: Path) -> None:
    """Their length is that between the half spheres, twice what MuJoCo calls their size."""
    model = ff.FreeFloatingModel.from_urdf(written(tmp_path), "hand")
    shapes = [link.shapes[0].geometry for link in model.description.links]
    assert [type(shape).__name__ for shape in shapes] == ["Box", "Capsule", "Capsule", "Sphere"]
    assert (shapes[1].radius, shapes[1].length) == (0.05, pytest.approx(0.6))
    assert (shapes[2].radius, shapes[2].length) == (0.04, pytest.approx(0.5))


FOLDED = """<mujoco><worldbody><body name="bus"><freejoint/>
<geom type="box" size=".5 .5 .5" density="200"/>
<body name="l1" pos=".5 0 0"><joint name="q1" axis="0 0 1"/>
<geom type="capsule" fromto="0 0 0 1 0 0" size=".05"/>
<body name="hand" pos="1 0 0"><joint name="q2" axis="0 0 1"/>
<geom type="capsule" fromto="0 0 0 1 0 0" size=".05" {shape}/><site name="tip" pos="1 0 0"/>
</body></body></body></worldbody>{tail}</mujoco>"""


@pytest.mark.parametrize(
    ("shape", "tail", "compared"),
    [("", "", True), ('contype="0" conaffinity="0"', "", False), ('contype="2"', "", True),
     ('contype="2" conaffinity="2"', "", False),
     ("", '<contact><exclude body1="bus" body2="hand"/></contact>', False)],
)  # fmt: skip
def test_shapes_that_touch_in_mujoco_are_compared(shape, tail, compared, tmp_path):
    """Bits and exclusions of MuJoCo decide, as MuJoCo finds contact between the two bodies."""
    text = FOLDED.format(shape=shape, tail=tail)
    (tmp_path / "folded.xml").write_text(text)
    model = ff.FreeFloatingModel.from_urdf(tmp_path / "folded.xml", "tip")
    simulation = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(simulation)
    data.qpos[-2:] = folded = np.array([0.3, 2.9])
    mujoco.mj_forward(simulation, data)
    bodies = [{int(simulation.geom_bodyid[g]) for g in contact.geom} for contact in data.contact]
    assert ({1, 3} in bodies) is compared
    stances = folded, folded + np.array([0.0, 0.05])
    ends = (model.end_effector_pose([0, 0, 0, 1], q).position for q in stances)
    line, margin = ff.paths.PolynomialCurve.line(*ends), ("gjm", 0.0)
    problem = ff.Problem(model, path=line, duration=20, margin=margin, task="planar-position")
    problem = problem.replace(limits=ff.Limits())
    violation = ff.simulate(problem, heading=0.0, joints=folded).violation
    assert ("clearance" in violation) is compared


HEAD = """
<option timestep="0.001"
  gravity="0 0 -9.81"/>
<default><joint armature="0.1"/><default class="soft"><joint damping="2"/></default></default>
<asset><mesh name="tet" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>"""
MORE = """<body name="finger" gravcomp="1">
<joint name="f" type="slide" class="soft" range="0 1" stiffness="3"
  springref="0.2" frictionloss="0.5" actuatorfrcrange="-5 5"/>
<geom name="shell" type="mesh"
  mesh="tet" mass="1"/>
<geom name="egg" type="ellipsoid" size="0.1 0.2 0.3" mass="1"/></body>"""
TAIL = """<contact><exclude name="near" body1="bus" body2="upper"/></contact>
<tendon><fixed name="cable"><joint joint="q1" coef="1"/></fixed></tendon>
<equality><joint name="gear" joint1="q2" joint2="q3"/></equality>
<actuator>
<motor name="motor" joint="q1" gear="50" forcerange="-4 4"/></actuator>"""
UNUSED = {
    ("joint f", "damping"), ("joint f", "stiffness"), ("joint f", "springref"),
    ("joint f", "frictionloss"), ("joint f", "actuatorfrcrange"), ("body finger", "gravcomp"),
    ("geom shell of body finger", "type"), ("geom egg of body finger", "type"),
    ("geom box of body bus", "friction"), ("tendon cable", ""),
    ("equality gear", ""), ("actuator motor", ""), ("option", "gravity"), ("option", "timestep"),
    ("body target", ""), ("geom floor of the world", ""),
}  # fmt: skip


def test_what_is_not_used_is_listed_once(tmp_path: Path) -> None:
    before = '<geom name="floor" type="plane" size="5 5 1"/><body name="target" mocap="true"/>'
    file = written(
        tmp_path, more=MORE, head=HEAD, tail=TAIL, before=before, box='friction="0.3 0.005 0.0001"'
    )
    info = document("info", file, "--end-effector", "finger")
    assert any("equality" in finding["problem"] for finding in info["findings"])
    listed = info["not_read"]
    entries = [(entry["element"], entry["attribute"]) for entry in listed]
    assert set(entries) == UNUSED
    assert len(entries) == len(UNUSED)
    text = file.read_text().split("\n")
    lines = {entry["element"]: entry["line"] for entry in listed}
    for element, begin in (("option", "<option"), ("joint f", '<joint name="f"'),
                           ("geom shell of body finger", '<geom name="shell"'),
                           ("actuator motor", "<motor")):  # fmt: skip
        assert begin in text[lines[element] - 1]
    shown = run("info", file, "--end-effector", "finger").stdout
    assert all(text in shown for text in ("springref", "gravcomp", "0 to 1 m"))


def test_elements_without_names_are_listed_each(tmp_path: Path) -> None:
    more = """<geom type="ellipsoid" size="0.1 0.2 0.3"/><geom type="mesh" mesh="tet"/>
    <geom type="ellipsoid" size="0.1 0.1 0.2"/><site name="imu"/>"""
    tail = """<sensor><gyro site="imu"/><accelerometer name="acc" site="imu"/></sensor>
    <keyframe><key name="home"/><key/></keyframe>"""
    floor = '<geom type="plane" size="1 1 1"/>'
    root = "".join([*SLIDES, *HINGES]).replace("/>", ' armature="1"/>')
    root = re.sub(r'name="\w+"', "", root)
    file = written(tmp_path, root, more, head=HEAD[HEAD.index("<asset") :], tail=tail,
                   before=2 * floor)  # fmt: skip
    listed = [entry["element"] for entry in document("info", file)["not_read"]]
    assert sorted(listed) == sorted([
        *(f"joint bus_joint_{number}" for number in range(1, 7)),
        *(f"geom number {number} of body hand" for number in (2, 3, 4)),
        *(f"geom number {number} of the world" for number in (1, 2)),
        "sensor number 1", "sensor acc", "key home", "key number 2",
    ])  # fmt: skip


def test_a_model_of_what_is_used_has_nothing_else(tmp_path: Path) -> None:
    file = written(tmp_path, head='<compiler autolimits="true"/><option gravity="0 0 0"/>',
                   more='<site name="tip"/>')  # fmt: skip
    assert document("info", file)["not_read"] == []


BODY = '<body name="{}">{}<geom size="1"/>{}</body>'
NO_ARMS = {
    "no body": ('<geom size="1"/>', "root"),
    "two roots": (BODY.format("a", "", "") + BODY.format("b", "", ""), "root"),
    "a ball in the arm": (
        BODY.format("a", "<freejoint/>", BODY.format("b", '<joint type="ball"/>', "")), "urdf"),
    "not closed": ("<body>", "urdf"),
}  # fmt: skip


@pytest.mark.parametrize(("bodies", "key"), NO_ARMS.values(), ids=NO_ARMS)
def test_models_that_are_no_arms_are_refused(bodies: str, key: str, tmp_path: Path) -> None:
    file = tmp_path / "robot.xml"
    file.write_text(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    assert error_key(ff.FreeFloatingModel.from_urdf, file) == key
