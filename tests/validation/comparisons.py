"""Comparisons and their tolerances: the table of validation in docs."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Comparison:
    """A row of the table.

    Attributes:
        file: Of the test, in this folder, without its ending.
        test: The test that makes the comparison.
        what: Of freefloat.
        against: What it is compared with.
        allowed: The test fails when they are farther apart.
        unit: Of the deviation.
    """

    file: str
    test: str
    what: str
    against: str
    allowed: float
    unit: str


COMPARISONS = tuple(Comparison(*row) for row in (
    ("test_paper", "test_example_2_becomes_singular_at_c_from_the_bad_attitude",
     "where four branches of Example 2 become singular, B as printed", "the paper's C", 3e-3, "m"),
    ("test_paper", "test_example_2_becomes_singular_at_c_with_b_in_its_plane",
     "the same with B in the plane (41)", "the paper's C", 1e-4, "m"),
    ("test_paper", "test_the_printed_touch_point_leads_back_to_the_printed_attitude",
     "Example 2's initial attitude, from its touch point", "the paper", 5e-4, "of 1"),
    ("test_paper", "test_printed_touch_points_lead_to_the_printed_headings",
     "Example 1's headings through touch points", "the paper", 0.06, "deg"),
    ("test_paper", "test_published_ranges_of_example_1",
     "Example 1's feasible heading ranges, at A and at F", "the paper", 0.5, "deg"),
    ("test_paper", "test_published_planar_barycentric_lengths",
     "barycentric lengths", "the paper", 5e-7, "m"),
    ("test_planar_golden", "test_planar_golden_values",
     "D, det A, det S* of three planar systems", "three other codes", 1e-9, "SI"),
    ("test_planar_golden", "test_planar_determinant_equals_the_closed_form",
     "det A of random planar arms", "(21a) from masses and lengths", 1e-9, "of the largest"),
    ("test_spart", "test_spart_finds_the_same_generalized_jacobian",
     "S* of random arms of every structure", "SPART", 1e-12, "of the largest"),
    ("test_mujoco", "test_mujoco_finds_the_same_generalized_jacobian",
     "S* of random arms of every structure", "MuJoCo", 1e-10, "of the largest"),
    ("test_mujoco", "test_mujoco_sees_the_end_effector_on_the_path",
     "end-effector pose in Examples 1 and 2", "MuJoCo's kinematics", 1e-8, "m, of 1"),
    ("test_mujoco", "test_the_motion_needs_no_wrench_on_the_base",
     "wrench on the base in Examples 1 and 2", "zero, by MuJoCo's inverse dynamics", 1e-4,
     "of the torques"),
    ("test_mujoco", "test_mujoco_finds_the_same_joint_torques",
     "joint torques of four arms", "MuJoCo's inverse dynamics", 1e-9, "of the largest"),
    ("test_mujoco", "test_servos_lead_to_the_same_attitude",
     "final attitude of Example 2 and the UR5", "MuJoCo's simulation, base free", 1e-3, "rad"),
    ("test_plain_integration", "test_a_plain_integration_agrees",
     "motions of nine arms and tasks", "SciPy, in time, from the mass matrix", 1e-7, "rad, m"),
    ("test_plain_integration", "test_the_centre_of_mass_stays_put",
     "centre of mass of recorded motions", "the origin, by Pinocchio", 1e-13, "m"),
    ("test_limits_of_physics", "test_heavy_base_recovers_the_fixed_base_arm",
     "S* minus the fixed-base Jacobian, spacecraft 100 times heavier",
     "a hundredth of the difference", 0.02, "of it"),
    ("test_limits_of_physics", "test_out_and_back_returns_the_start",
     "forward, then backward with -h", "the start", 1e-7, "rad, m"),
    ("test_limits_of_physics", "test_without_momentum_the_end_does_not_depend_on_time",
     "five time laws and durations without momentum", "the same end", 1e-8, "rad, m"),
    ("test_limits_of_physics", "test_a_closed_joint_loop_turns_the_spacecraft_by_the_golden_angle",
     "rotation of the spacecraft after a closed loop of joints",
     "-2.35462974398 deg, from a quadrature", 1e-7, "deg"),
    ("test_brute_force", "test_random_ranges_agree_with_brute_force",
     "heading range limits of 5 random problems", "sweep and bisection", 0.05, "deg"),
    ("test_brute_force", "test_a_map_agrees_with_precise_motions",
     "minimum margins of a map, Example 2", "precise motions", 3e-4, "of the initial S"),
    ("test_scene", "test_ten_revolutions_are_those_of_jacobi",
     "ten revolutions of tumbling bodies", "Jacobi's elliptic functions", 1e-9, "of 1"),
    ("test_scene", "test_distances_from_a_ball_are_exact",
     "distances from a ball to boxes and balls", "closed forms", 1e-6, "m"),
    ("test_scene", "test_distances_of_meshes_are_those_of_mujoco",
     "distances from meshes of two arms to other bodies", "MuJoCo's mj_geomDistance", 5e-6, "m"),
))  # fmt: skip
"""All rows, in the table's order."""

WORST: dict[str, float] = {}
"""Largest deviations seen since the start, by test."""


def assert_agrees(test: str, deviation: float) -> None:
    """Keep a deviation found by a test, and fail when it is more than is allowed."""
    (row,) = (row for row in COMPARISONS if row.test == test)
    WORST[test] = max(WORST.get(test, 0.0), float(deviation))
    assert deviation <= row.allowed, f"{row.what}: off by {deviation:.3g}, allowed {row.allowed:g}"


def lines(deviations: dict[str, str]) -> list[str]:
    """Table of a page of the docs in Markdown, of largest deviations as text by test."""
    head = [
        "| result | compared with | largest deviation | tolerance | test |",
        "|---|---|---|---|---|",
    ]
    return head + [
        f"| {row.what.replace('*', chr(92) + '*')} | {row.against} |"
        f" {deviations[row.test]} {row.unit} |"
        f" {row.allowed:g} | [{row.file}](../tests/validation/{row.file}.py) |"
        for row in COMPARISONS
    ]
