"""Robots on a table, beside Pinocchio's planar root joint with SciPy, and beside MuJoCo."""

import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.beyond.engines.mujoco import MuJoCo
from freefloat.certificate.certificate import certify
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.so3 import heading_quaternion
from freefloat.verification import range_checks
from freefloat.verification.comparisons import Check
from tests.errors import error_key
from tests.motions import from_here
from tests.robots import pin_configuration, planar_robot, random_robot

STRUCTURES = {
    "RRRRRR": "pose", "RRRRR": "pointing", "RRR": "position", "RPR": "position",
    "PRRRRR": "pose", "RRRP": "position", "RRRRRRR": "pose", "RR": "planar-position",
}  # fmt: skip
"""Structures of arms and tasks, those of redundant arms with the rates of least norm."""


class PlanarRoot:
    """A robot of Pinocchio on its planar root joint, and the equation of its rates."""

    def __init__(self, problem: ff.Problem, text: str) -> None:
        self.problem, model = problem, problem.model
        self.model = pin.buildModelFromXML(text, pin.JointModelPlanar())
        self.data = self.model.createData()
        self.tool = self.model.getFrameId(model.end_effector)
        order = [self.model.names[k] for k in range(2, self.model.njoints)]
        self.places = [3 + order.index(name) for name in model.joint_names]

    def matrices(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Conserved momenta, shape (3, 3 + n), and the Jacobian of the task's rows, base axes."""
        x, z, heading, *joints = y
        q = pin_configuration(self.model, dict(zip([*self.model.names][2:], joints, strict=True)))
        q[:4] = x, z, np.cos(heading), np.sin(heading)
        momenta = pin.computeCentroidalMap(self.model, self.data, q)[[0, 1, 5]]
        task = self.problem.task
        frame = pin.LOCAL if task is ff.Task.POINTING else pin.LOCAL_WORLD_ALIGNED
        J = pin.computeFrameJacobian(self.model, self.data, q, self.tool, frame)
        return np.array(momenta), np.array(J[task.rows])

    def rates(self, t: float, y: np.ndarray) -> np.ndarray:
        """Rates of x, y, heading and joints, of the least norm of the joints'."""
        momenta, J = self.matrices(y)
        twist = np.array(self.problem.path.twist(t))
        if self.problem.task is ff.Task.POINTING:
            R = pin.updateFramePlacement(self.model, self.data, self.tool).rotation
            twist = (twist.reshape(2, 3) @ R).ravel()
        h = self.problem.momentum - self.problem.wheel_momentum
        base = np.linalg.solve(momenta[:, :3], np.c_[momenta[:, 3:], [0.0, 0.0, h[2]]])
        S = J[:, 3:] - J[:, :3] @ base[:, :-1]
        u = np.linalg.pinv(S) @ (twist[self.problem.task.rows] - J[:, :3] @ base[:, -1])
        body = base[:, -1] - base[:, :-1] @ u
        c, s = np.cos(y[2]), np.sin(y[2])
        return np.array([c * body[0] - s * body[1], s * body[0] + c * body[1], body[2], *u])


def raised(rng: np.random.Generator) -> str:
    """A planar arm of two joints at a random height above the root link of its spacecraft."""
    text = planar_robot(
        [*rng.uniform([30.0, 2.0, 1.0], [60.0, 5.0, 4.0])], [*rng.uniform(0.2, 2.0, 3)],
        [*rng.uniform(0.2, 0.6, 2)], [*rng.uniform(0.2, 0.6, 3)],
    )  # fmt: skip
    first = ' 0 0" rpy="0 0 0"/><axis'
    return text.replace(first, first.replace('0"', f'{rng.uniform(0.1, 0.8)!r}"', 1), 1)


def on_table(
    number: int, structure: str | None = None
) -> tuple[ff.Problem, np.ndarray, np.ndarray, str]:
    """A random robot on a table, its attitude and joints, and its URDF with the arm in order."""
    rng = np.random.default_rng([58, number])
    structure = structure or [*STRUCTURES][number % len(STRUCTURES)]
    task, end_effector = ff.Task(STRUCTURES[structure]), "end_effector"
    if task.planar:
        text = raised(rng)
    else:
        robot = random_robot(rng, structure)
        text, end_effector = robot.text, robot.end_effector
    model = ff.FreeFloatingModel.from_urdf(text, end_effector, base="planar")
    attitude = heading_quaternion(float(rng.uniform(0.0, 6.0)))
    joints = rng.uniform(-1.5, 1.5, model.dof)
    problem = from_here(
        model, task, [0.0, 0.0, model.total_mass / 400.0 * rng.normal()], attitude, joints,
        rng.uniform(-0.2, 0.2, 3) * ([1.0, 1.0, 0.0] if task.planar else 1.0),
        rng.uniform(-0.2, 0.2, 3), ff.Timing(20.0),
    )  # fmt: skip
    wheels = [0.0, 0.0, float(rng.normal())] if number % 3 == 0 else [0.0, 0.0, 0.0]
    return problem.replace(wheel_momentum=wheels), attitude, joints, text


@pytest.mark.slow
@pytest.mark.parametrize("number", range(12))
def test_motions_are_those_of_a_planar_root_joint(number: int) -> None:
    problem, attitude, joints, text = on_table(number)
    other = PlanarRoot(problem, text)
    x, y, _ = problem.model.base_position(attitude, joints)
    start = [x, y, 2.0 * np.arctan2(attitude[2], attitude[3]), *joints]
    momenta, J = other.matrices(np.array([0.0, 0.0, 0.0, *joints]))
    S = J[:, 3:] - J[:, :3] @ np.linalg.solve(momenta[:, :3], momenta[:, 3:])
    own = ff.generalized_jacobian(problem.model, joints, problem.task)
    np.testing.assert_allclose(own, S, atol=1e-12)
    motion = ff.integrate_motion(problem, attitude, joints, tolerance=1e-13)
    last = 0.9 * motion.final.time
    reference = solve_ivp(
        other.rates, (0.0, last), start, "DOP853", rtol=1e-13, atol=1e-13, dense_output=True
    ).sol
    for state in motion.sample(np.linspace(0.0, last, 9)):
        x, y, heading, *values = reference(state.time)
        np.testing.assert_allclose(state.joints, values, atol=1e-9)
        np.testing.assert_allclose(state.base_position, [x, y, 0.0], atol=1e-9)
        turned = Rotation.from_quat(state.attitude).as_rotvec() - [0.0, 0.0, heading]
        assert abs(np.angle(np.exp(1j * np.linalg.norm(turned)))) < 1e-9


@pytest.mark.parametrize("number", [1, 3, 5, 6])
def test_the_kernels_agree_with_the_reference_engine(number: int) -> None:
    problem, attitude, joints, _ = on_table(number)
    precise = ff.integrate_motion(problem, attitude, joints)
    ensemble = EnsembleIntegrator(problem, tolerance=1e-11)
    motions = ensemble.integrate(attitude[None], joints[None])
    smallest = ff.closest_approach(precise, problem.margin.measure).value
    if precise.completed:
        assert abs(motions.minimum[0] - smallest) < 1e-7 * max(1.0, smallest)
        np.testing.assert_allclose(motions.joints[0], precise.final.joints, atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("number", [3, 5, 6])
def test_mujoco_repeats_a_motion_with_slides_and_a_hinge(number: int) -> None:
    problem, attitude, joints, _ = on_table(number)
    problem = problem.replace(wheel_momentum=[0.0, 0.0, 0.0])
    runs = MuJoCo().repeated(ff.integrate_motion(problem, attitude, joints))
    assert [check.reason for check in runs.checks if not check.passed] == []
    assert runs.forward.attitude < 1e-5


@pytest.mark.parametrize("number", [0, 4, 5])
def test_joint_torques_bear_the_gravity_on_a_table(number: int) -> None:
    problem, attitude, joints, text = on_table(number)
    problem = problem.replace(model=replace(problem.model, gravity=9.81))
    motion, other = ff.integrate_motion(problem, attitude, joints), PlanarRoot(problem, text)
    other.model.gravity.linear = np.array([0.0, 0.0, -9.81])
    effort, moves = motion.node_effort, [0, 1, 5, *range(6, 6 + problem.model.dof)]
    for panel in range(0, motion.panels, 3):
        node = 8 * panel
        heading = 2.0 * np.arctan2(*motion.attitudes[node, 2:])
        q = np.array([0.0, 0.0, np.cos(heading), np.sin(heading), *motion.joints[node]])
        rates, accelerations = effort.rates[panel, 0, moves], effort.accelerations[panel, 0, moves]
        forces = pin.rnea(other.model, other.data, q, rates, accelerations)
        size = np.abs(forces).max()
        np.testing.assert_allclose(effort.joint_torques[panel, 0], forces[3:], atol=1e-11 * size)
    weightless = ff.integrate_motion(replace(problem, model=replace(problem.model, gravity=0.0)),
                                     attitude, joints)  # fmt: skip
    np.testing.assert_array_equal(motion.joints, weightless.joints)


def test_a_scenario_states_gravity_and_a_free_base_has_none() -> None:
    scenario = ff.load_scenario("ur5_servicer/table")
    content = scenario.content.model_dump(exclude_unset=True, by_alias=True)
    content["robot"]["gravity"] = 9.81
    assert ff.load_scenario(content).model().pin_model.gravity.linear[2] == -9.81
    content["robot"]["base"] = "free"
    assert error_key(lambda: ff.load_scenario(content).model()) == "robot.gravity"


@pytest.mark.slow
def test_the_fastest_timing_bears_gravity_and_is_verified(tmp_path, monkeypatch) -> None:
    """From the attitude of the largest margin it takes more than 50 N m, at any timing."""
    untried = Check("ranges of headings", True)  # they do not depend on gravity
    monkeypatch.setattr(range_checks, "_heading_check", lambda *_: untried)
    robot = ff.load_scenario("ur5_servicer/table").content.robot.model_dump(exclude_unset=True)
    plan = ff.load_scenario({
        "robot": robot | {"gravity": 9.81}, "task": "pose",
        "path": {"line": {"from": [0.75, -0.3, 0.7], "to": [0.75, 0.3, 0.75]},
                 "attitude": {"fixed": {"rpy": [0, 1.5707963268, 0]}}},
        "timing": {"duration": 5, "law": "optimal"}, "margin": {"measure": "gjm", "value": 0.001},
        "limits": {"joint_torque": 47.0, "joint_acceleration": 1.0, "clearance": "off"},
    }).plan()  # fmt: skip
    assert plan.feasible, plan.reason
    assert plan.problem.path.duration < 5.0
    ratios = {entry.limit: entry.ratio for entry in plan.limit_results}
    assert ratios["joint_torque"] > 0.3
    assert max(ratios.values()) == pytest.approx(1.0, abs=1e-3)
    ff.save(plan, tmp_path / "table.h5")
    loaded = ff.load(tmp_path / "table.h5")
    assert loaded.problem.model.gravity == 9.81
    assert ff.check(loaded, "mujoco").passed


def test_a_certificate_bounds_the_margin_on_a_table() -> None:
    problem, attitude, joints, _ = on_table(0)
    certificate = certify(ff.integrate_motion(problem, attitude, joints))
    for minimum in certificate.minima:
        assert 0.85 * minimum.value < minimum.bound <= minimum.value
    assert certificate.integration.joints < 1e-8


def test_ranges_of_a_spatial_arm_on_a_table_end_where_its_margin_does() -> None:
    plan = ff.load_scenario("ur5_servicer/table").plan(threads=1)
    problem, nearby = plan.problem, 1e-5  # degrees
    arm = plan.ranges[1]
    ends = [(first, 1.0) for first, _ in arm.degrees] + [(last, -1.0) for _, last in arm.degrees]
    kept = []
    for end, inward in ends:
        if 0.0 < end < 360.0:  # else the range goes on
            for sign in (inward, -inward):
                attitude = heading_quaternion(np.radians(end + sign * nearby))
                motion = ff.integrate_motion(
                    problem, attitude, problem.branches(attitude)[1].joints
                )
                least = ff.closest_approach(motion, problem.margin.measure).value
                kept.append(motion.completed and least >= problem.margin.threshold)
    assert kept == [True, False] * 2


@pytest.mark.parametrize(
    ("key", "value"), [("momentum", [0.1, 0.0, 0.2]), ("wheel_momentum", [0.0, 0.3, 0.0])]
)
def test_momenta_that_a_table_carries_are_refused(key: str, value: list[float]) -> None:
    problem, *_ = on_table(2)
    with pytest.raises(ff.InputError) as error:
        problem.replace(**{key: value})
    assert error.value.key in ("momentum", "wheels.momentum")


def test_attitudes_that_leave_the_table_are_refused() -> None:
    problem, _, q, _ = on_table(0)
    tilted, system, client = [0.6, 0.0, 0.0, 0.8], problem.system, ff.Client(5.0, [1.0, 1.0, 1.0])
    for wrong in (
        lambda: problem.branches(tilted),
        lambda: system.base_rate(tilted, q, q),
        lambda: system.base_rate([heading_quaternion(0.4), tilted], [q, q], [q, q]),
        lambda: system.base_twist(tilted, q, q),
        lambda: ff.capture(system, client, tilted, q, q),
    ):
        assert error_key(wrong) == "attitude"


def test_the_height_of_a_planar_arm_does_not_matter() -> None:
    high = raised(np.random.default_rng(3))
    low = re.sub(r' 0 0\.\d+" rpy', ' 0 0" rpy', high, count=1)
    found = []
    for text in (low, high):
        model = ff.FreeFloatingModel.from_urdf(text, "end_effector", base="planar")
        z = model.end_effector_pose([0.0, 0.0, 0.0, 1.0], [0.3, 0.9]).position[2]
        line = ff.paths.PolynomialCurve.line([0.9, 0.1, z], [0.7, 0.5, z])
        problem = ff.Problem(model, path=line, duration=20, margin=("sigma", 0.03))
        link = next(iter(model.link_places))
        many = ff.simulate_many(problem, headings=0.2, branch=0, scale_mass={link: [1.0, 1.3]})
        plan = ff.plan(problem)
        found.append([plan.chosen.minimum_margin, *many.minimum_margins])
        found[-1] += [limit for entry in plan.ranges for low_high in entry.ranges
                      for limit in (low_high.low, low_high.high)]  # fmt: skip
    assert abs(z) > 0.1
    np.testing.assert_allclose(*found, atol=1e-9)


@pytest.mark.parametrize("number", [0, 2, 3])
def test_a_capture_conserves_what_a_table_does_not_carry(number: int) -> None:
    problem, attitude, joints, _ = on_table(number)
    problem = problem.replace(wheel_momentum=[0.0, 0.0, 0.0])
    rng = np.random.default_rng(number)
    turn, velocity = 0.1 * rng.normal(size=3), 0.05 * rng.normal(size=3)
    client = ff.Client(30.0, [2.0, 3.0, 2.5], angular_velocity=turn, velocity=velocity)
    rates = 0.05 * rng.normal(size=problem.model.dof)
    after = ff.capture(problem.system, client, attitude, joints, rates)
    base = after.system.base_rate(attitude, joints, after.joint_rates)
    np.testing.assert_allclose(after.base_rate, base, atol=1e-12)
    assert not after.momentum[:2].any()


@pytest.mark.slow
@pytest.mark.parametrize(("goal", "raised"), [
    ({"attitude": [0, 0, 0.17364818, 0.98480775]}, 0.0),
    ({"pose": {"position": [0.7, 0.3, 0.8], "orientation": {"rpy": [0, 1.2, 0.3]}}}, 0.0),
    ({"pose": {"position": [0.7, 0.3, 1.8], "orientation": {"rpy": [0, 1.2, 0.3]}}}, 1.0),
])  # fmt: skip
def test_motions_to_goals_on_a_table_are_verified(goal: dict[str, object], raised: float) -> None:
    robot = ff.load_scenario("ur5_servicer/table").content.robot.model_dump(exclude_unset=True)
    mount = robot["spacecraft"]["mount"]
    mount["xyz"] = [*mount["xyz"][:2], mount["xyz"][2] + raised]
    joints = [-0.46, -0.85, 1.4, 2.6, -0.93, 1.57]
    search = {"from_attitude": [0, 0, 0, 1], "joints": joints}
    limits = {"joint_rate": 0.3, "clearance": False}
    found = ff.load_scenario(
        {"robot": robot, "goal": goal, "search": search, "limits": limits}
    ).plan()
    assert found.feasible, found.reason
    assert np.abs(found.motion.attitudes[:, :2]).max() < 1e-12
    assert ff.check(found, "mujoco").passed
