"""Exports read by the tools they are for: ROS 2, MCAP, CCSDS and MuJoCo."""

import csv
import re
from datetime import UTC, datetime
from pathlib import Path

import mujoco
import numpy as np
import pytest
import yaml
from ccsds_ndm.ndm_io import NdmIo
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.beyond.formats.mjcf_file import mjcf_text
from freefloat.beyond.formats.ros2 import ros2_goal_text, ros2_text
from freefloat.io.trajectory import Header, Trajectory
from freefloat.motion.motion import Motion
from freefloat.so3 import angle_between
from tests.commands import document, error, run
from tests.errors import error_key
from tests.motions import bundled, first_motion

EPOCH = datetime(2026, 5, 1, 12, 0, 0, 250_000, tzinfo=UTC)
GOAL = {
    "control_msgs/msg/JointTolerance":
        "string name\nfloat64 position\nfloat64 velocity\nfloat64 acceleration",
    "control_msgs/msg/FollowJointTrajectoryGoal":
        "trajectory_msgs/JointTrajectory trajectory\n"
        "control_msgs/JointTolerance[] path_tolerance\n"
        "control_msgs/JointTolerance[] goal_tolerance\n"
        "builtin_interfaces/Duration goal_time_tolerance",
}  # fmt: skip
"""Definitions of control_msgs, without fields for planar joints."""
QUANTITIES = (
    ("position", "rad"), ("velocity", "rad/s"), ("acceleration", "rad/s^2"), ("torque", "N m"),
)  # fmt: skip
"""Columns of a revolute joint."""


@pytest.fixture(scope="module")
def motion() -> Motion:
    return first_motion(bundled("ets_vii/inspect"))


@pytest.fixture(scope="module")
def trajectory(motion) -> Trajectory:
    assert np.abs(motion.problem.momentum).max() > 0.0
    return Trajectory.sampled(motion, 301, header=Header(EPOCH))


@pytest.mark.slow
def test_ros_2_reads_a_goal_with_tolerances(trajectory) -> None:
    goal = yaml.safe_load(ros2_goal_text(trajectory))
    assert yaml.safe_load(ros2_text(trajectory)) == goal["trajectory"]
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in GOAL.items():
        store.register(get_types_from_msg(text, name))

    def message(name, values):
        """A message from nested maps and lists, which have its fields and no others."""
        _, definitions = store.fielddefs[name]
        fields = {}
        for key, (kind, of) in definitions:
            value = values[key]
            if kind is Nodetype.NAME:
                value = message(of, value)
            elif kind is Nodetype.SEQUENCE:
                (inner, part), _ = of
                named = inner is Nodetype.NAME
                value = [message(part, entry) for entry in value] if named else np.array(value)
            fields[key] = value
        assert fields.keys() == values.keys()
        return store.types[name](**fields)

    name = "control_msgs/msg/FollowJointTrajectoryGoal"
    read = store.deserialize_cdr(store.serialize_cdr(message(name, goal), name), name)
    assert read.trajectory.joint_names == list(trajectory.motion.model.joint_names)
    rows = [point.positions for point in read.trajectory.points]
    np.testing.assert_allclose(rows, trajectory.joints, rtol=0, atol=1e-9)
    assert all(entry.position > 0.0 for entry in [*read.path_tolerance, *read.goal_tolerance])


@pytest.mark.slow
def test_an_mcap_reader_reads_joints_transforms_and_margin(trajectory, tmp_path) -> None:
    file = tmp_path / "motion.mcap"
    ff.export(trajectory.motion, file, times=301, epoch=EPOCH)
    model = trajectory.motion.model
    topics: dict[str, list] = {}
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for message in reader.iter_decoded_messages():
            topics.setdefault(message.channel.topic, []).append(message)
    assert topics["/robot_description"][0].decoded_message.data == model.description.text
    states = topics["/joint_states"]
    joints = [message.decoded_message.position for message in states]
    np.testing.assert_allclose(joints, trajectory.joints, rtol=0, atol=1e-9)
    zero = int(EPOCH.timestamp() * 1e6) * 1000
    times = np.array([message.message.log_time - zero for message in states])
    np.testing.assert_allclose(times * 1e-9, trajectory.times, atol=1e-9)
    margins = [message.decoded_message.data for message in topics["/margin"]]
    np.testing.assert_allclose(margins, trajectory.measure, rtol=1e-12)
    frames = {
        entry.child_frame_id: entry.transform
        for entry in topics["/tf"][-1].decoded_message.transforms
    }
    assert set(frames) == {link.name for link in model.description.links_by_name.values()}
    pose = model.end_effector_pose(trajectory.attitudes[-1], trajectory.joints[-1])
    found = frames[model.end_effector]
    place = [getattr(found.translation, axis) for axis in "xyz"]
    turn = Rotation.from_quat([getattr(found.rotation, axis) for axis in "xyzw"]).as_matrix()
    np.testing.assert_allclose(place, pose.position, atol=1e-9)
    np.testing.assert_allclose(turn, pose.rotation, atol=1e-9)


@pytest.mark.slow
def test_a_parser_of_ccsds_messages_reads_attitudes_and_dates(trajectory, tmp_path) -> None:
    file = tmp_path / "motion.aem"
    names = {"frame": "GCRF", "object_name": "SERVICER", "object_id": "2026-001A"}
    ff.export(trajectory.motion, file, times=301, epoch=EPOCH, **names)
    (segment,) = NdmIo().from_path(file).body.segment
    about = segment.metadata
    assert [about.ref_frame_a, about.object_name, about.object_id] == list(names.values())
    assert segment.metadata.start_time == "2026-05-01T12:00:00.250000000"
    states = [state.quaternion_state for state in segment.data.attitude_state]
    read = [[s.quaternion.q1, s.quaternion.q2, s.quaternion.q3, s.quaternion.qc] for s in states]
    assert angle_between(np.array(read), trajectory.attitudes).max() < 1e-9
    seconds = [
        (datetime.fromisoformat(state.epoch[:26]) - EPOCH.replace(tzinfo=None)).total_seconds()
        for state in states
    ]
    np.testing.assert_allclose(seconds, trajectory.times, atol=1.1e-6)


@pytest.mark.parametrize(
    ("name", "spacecraft"),
    [("ur5_servicer/arc", "spacecraft"), ("planar_2dof/line", "planar_2dof")],
)
def test_an_ephemeris_names_the_spacecraft_and_not_its_arm(name, spacecraft, tmp_path) -> None:
    """A robot that is a spacecraft already keeps its name."""
    ff.export(first_motion(bundled(name)), tmp_path / "motion.aem", times=5)
    about = NdmIo().from_path(tmp_path / "motion.aem").body.segment[0].metadata
    assert about.object_name == about.object_id == spacecraft


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ets_vii/inspect", "ur5_servicer/table"])
def test_mujoco_reads_the_robot_and_both_ends(name: str) -> None:
    trajectory = Trajectory.sampled(first_motion(bundled(name)), 21)
    problem = trajectory.motion.problem
    model = mujoco.MjModel.from_xml_string(mjcf_text(trajectory))
    data = mujoco.MjData(model)
    for key, k in (("initial", 0), ("final", -1)):
        mujoco.mj_resetDataKeyframe(model, data, model.key(key).id)
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        known = slice(2, 3) if problem.model.on_table else slice(3)
        moved = data.subtree_com[1, :2] if problem.model.on_table else data.subtree_com[1]
        np.testing.assert_allclose(moved, 0.0, atol=1e-9)
        found = data.subtree_angmom[1, known]
        np.testing.assert_allclose(found, problem.momentum[known], atol=1e-9)
        pose = problem.model.end_effector_pose(trajectory.attitudes[k], trajectory.joints[k])
        site = model.site("end_effector").id
        np.testing.assert_allclose(data.site_xpos[site], pose.position, atol=1e-9)
        np.testing.assert_allclose(data.site_xmat[site].reshape(3, 3), pose.rotation, atol=1e-9)


@pytest.mark.slow
def test_names_of_a_robot_stay_names_in_exports(tmp_path) -> None:
    """Spreadsheets evaluate no cell."""
    problem = bundled("planar_2dof/line")
    text = problem.model.description.text
    for old, new in (("q1", "=1+1"), ("q2", "@x")):
        assert f'"{old}"' in text
        text = text.replace(f'"{old}"', f'"{new}"')
    robot = ff.FreeFloatingModel.from_urdf(text, problem.model.end_effector)
    named = first_motion(problem.replace(model=robot))
    ff.export(named, tmp_path / "motion.csv")
    with open(tmp_path / "motion.csv", newline="") as stream:
        heads, cells = next(rows := csv.reader(stream)), next(rows)
    assert [head for head in heads if head[0] in "=+-@'"] == [
        f"'{name} {quantity} [{unit}]" for quantity, unit in QUANTITIES for name in ("=1+1", "@x")
    ]
    assert all(np.isfinite(float(cell)) for cell in cells)


@pytest.mark.slow
def test_what_a_format_cannot_hold_is_refused(motion, tmp_path) -> None:
    wheels = motion.problem.replace(wheel_momentum=np.array([0.1, 0.0, 0.0]))
    start = motion.initial
    turning = ff.integrate_motion(wheels, start.attitude, start.joints)
    assert error_key(lambda: mjcf_text(Trajectory.sampled(turning, 3))) == "format"
    unphysical = Trajectory.sampled(first_motion(bundled("spatial_6dof/line")), 3)
    assert error_key(lambda: mjcf_text(unphysical)) == "format"
    for key, value in {"times": 5.5, "rate": "10", "frame": "Ümlaut"}.items():
        assert error_key(ff.export, motion, tmp_path / "motion.aem", **{key: value}) == key


@pytest.mark.slow
def test_the_command_names_files_and_axes(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    run("plan", "planar_2dof/line", "-o", "plan.h5")
    assert document("export", "plan.h5", "--format", "ros2-goal")["file"] == "plan_goal.yaml"
    run("export", "plan.h5", "--format", "aem", "--epoch", "2026-05-01T12:00:00")
    assert "2026-05-01T12:00:30" in Path("plan_trajectory.aem").read_text("utf-8")
    assert error("export", "plan.h5", "--format", "aem", "--object", " ")["key"] == "object"
    assert error("export", "plan.h5", "-o", "-", "--format", "mcap")["key"] == "output"
    assert re.match("CCSDS_AEM_VERS", run("export", "plan.h5", "-o", "-", "--format", "aem").stdout)
