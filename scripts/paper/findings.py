"""What was found about the paper while computing its numbers, each with how it was seen."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import freefloat as ff
from freefloat.robot.named_files import find_robot
from paper.examples import (
    BAD_ATTITUDE,
    H_EXCHANGED,
    H_PRINTED,
    INITIAL_ATTITUDE,
    NORMAL,
    OFFSET,
    PLANAR_TOUCH_JOINTS,
    TOUCH_JOINTS,
    example_1,
    example_2,
    initial_attitude,
    limits,
    near,
    plan_of_example_1,
    points_c,
    rounding,
    touch_point_of_example_2,
)


@dataclass(frozen=True)
class Finding:
    """A sentence about the paper, and how it was seen, in Markdown."""

    claim: str
    seen: str


def all_findings() -> Iterator[Finding]:
    yield point_b()
    yield momentum()
    yield in_plane_factor()
    yield inertia_of_body_3()
    yield no_rigid_body()
    yield rest_at_f()
    yield determinant_of_a()
    yield printed_digits()
    yield one_branch()


def point_b() -> Finding:
    B = example_2(moved=False).path.pose(100.0).position
    away = 1e3 * abs(NORMAL @ B - OFFSET) / np.linalg.norm(NORMAL)
    z = example_2().path.pose(100.0).position[2]
    printed, moved = (
        max(np.abs(C - [0.1214, 0.4686, 0.1943]).max() for C in points_c(moved=flag))
        for flag in (False, True)
    )
    return Finding(
        "The printed B of Example 2 is not in the plane (41).",
        f"It is {away:.1f} mm away, at right angles: its z has two digits, 0.33 m, and (41) gives"
        f" {z:.4f} m. Where the arm becomes singular, no coordinate of four branches differs from"
        f" the printed C by more than {printed:.1e} m with B as printed (the bundled"
        f" `spatial_6dof/line`), and by more than {moved:.0e} m with the z of (41).",
    )


def momentum() -> Finding:
    wrist = {
        h: np.abs(near(touch_point_of_example_2(h).joints, TOUCH_JOINTS) - TOUCH_JOINTS).max()
        for h in (H_PRINTED, H_EXCHANGED)
    }
    back = {h: np.abs(initial_attitude(h) - INITIAL_ATTITUDE).max() for h in wrist}
    return Finding(
        "At the touch point of Example 2 the first two components of the momentum are exchanged.",
        f"With h = (0.5, 0.3, 0.1) as printed the wrist joints differ by {wrist[H_PRINTED]:.1e}"
        f" rad, with (0.3, 0.5, 0.1) by {wrist[H_EXCHANGED]:.1e} rad. The motion back to A was"
        f" computed with h as printed: the initial attitude differs by {back[H_PRINTED]:.0e}, with"
        f" exchanged components by {back[H_EXCHANGED]:.0e}.",
    )


def in_plane_factor() -> Finding:
    model = example_2().model
    product, factor = (
        ff.singularity_measure(model, "pose", name)(TOUCH_JOINTS)
        for name in ("det S*", "in-plane factor")
    )
    return Finding(
        "S0 = -5 of Example 2 is not det S\\*, but a factor of det A = D det S\\*.",
        f"At the printed touch point det S\\* is {product:.4f} and the factor, the"
        f" [measure](concepts/measures.md#the-factor-arm) `in-plane factor`, is {factor:.4f}. The"
        " other factors belong to shoulder and wrist. (40) calls the product and the factor S.",
    )


def inertia_of_body_3() -> Finding:
    urdf = find_robot("spatial_6dof", Path()).read_text("utf-8")
    used, printed = 'iyy="1.7" iyz="0" izz="7.5"', 'iyy="7.5" iyz="0" izz="1.7"'
    models = [ff.FreeFloatingModel.from_urdf(text) for text in (urdf.replace(used, printed), urdf)]
    values = [
        ff.singularity_measure(model, "pose", "in-plane factor")(TOUCH_JOINTS) for model in models
    ]
    return Finding(
        "In Table II the z axis of body 3 is along its joint, not the y axis.",
        f"Joint 3 turns about the y axis of the arm when that is stretched. With I_yy = 7.5 kg m²"
        f" about it, as printed, S is {values[0]:.2f} at the printed touch point; with 1.7 kg m²,"
        f" the printed I_zz, it is {values[1]:.4f}. The paper prints -5.",
    )


def no_rigid_body() -> Finding:
    warnings = {w.element: w.problem for w in example_2().model.warnings}
    return Finding(
        "No rigid body has the inertia of body 3 in Table II.",
        f"`freefloat info spatial_6dof` warns: {warnings['link link_3']}. All numbers here are"
        " computed with the printed values.",
    )


def rest_at_f() -> Finding:
    high, low = plan_of_example_1("parabola_nonstop").ranges[0].degrees
    return Finding(
        "In Example 1 the end-effector rests at F.",
        f"The printed 161 and 63 degrees come out with one quintic (18b) for each segment. With one"
        f" quintic for the whole path the limits are {low[0]:.2f} and {high[1]:.2f} degrees:"
        " `freefloat plan planar_3dof/parabola_nonstop`.",
    )


def determinant_of_a() -> Finding:
    problem = example_1()
    det_S = ff.singularity_measure(problem.model, problem.task, "det S*")
    values = ", ".join(f"{det_S(joints):.4f}" for joints in PLANAR_TOUCH_JOINTS.values())
    return Finding(
        "(21a) is det A, not det S\\*.",
        f"At the three printed touch points det S\\* is {values} m². The printed S0 = 5 and"
        " largest S of about 150 are values of det A = D det S\\*, the"
        " [measure](concepts/measures.md) `det A`.",
    )


def printed_digits() -> Finding:
    S = example_1().margin.measure
    values = [f"{S(joints):.3f}" for joints in PLANAR_TOUCH_JOINTS.values()]
    least, most = (f(rounding(S, q) for q in PLANAR_TOUCH_JOINTS.values()) for f in (min, max))
    found = (limits(1)[0], *limits(0)[:2])  # of FB, then of AF
    pairs = zip(found, PLANAR_TOUCH_JOINTS.values(), strict=True)
    away = max(np.abs(near(limit.touch_point.joints, q) - q).max() for limit, q in pairs)
    return Finding(
        "The three printed touch points of Example 1 are not touch points to all their digits.",
        f"They are on S = 5: S is {values[0]}, {values[1]} and {values[2]} there, and the joints'"
        f" rounding alone changes it by up to {least:.3f} to {most:.3f}. But along that curve they"
        f" are up to {away:.0e} rad from where dS/dt = 0. The headings that follow from them agree"
        " to all digits, since they change with the square of this distance.",
    )


def one_branch() -> Finding:
    other = ff.simulate(example_1(), heading=np.radians(140.0), branch=1).chosen
    (low, high), *_ = plan_of_example_1().ranges[1].degrees[1:]
    branches = ff.simulate(example_2(), BAD_ATTITUDE).branches
    followed = sum(branch.motion.completed for branch in branches)
    return Finding(
        "One arm branch is considered, in Example 1 the one with S > 0.",
        f"Example 1 has two branches. From 140 degrees the other one, S < 0, follows the whole"
        f" path, with |S| down to {other.closest_approach.value:.2f}; from {low:.2f} to {high:.2f}"
        f" degrees it keeps |S| above 5. Example 2 has {len(branches)} branches; from its first"
        f" attitude, which leads to C, {followed} of them follow the whole path:"
        " `freefloat simulate spatial_6dof/line --attitude 0.1 0.5 0.2 -0.8367`.",
    )
