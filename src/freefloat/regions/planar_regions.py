"""Planar arms in complex numbers: momentum, S, margin curves, and distances on the path.

A point (x, y) is x + iy; a link at the absolute angle phi is multiplied by exp(i phi).
Arrays of angles have the shape (..., n + 1): the spacecraft's heading, then the absolute angle of
every link. For arms of two joints, or of three with a prescribed orientation, S depends on the
first two joint angles alone, and so does the distance of point 3 (the end-effector, or the joint of
the last link) from the centre of mass, at any heading: (21), (28). Elbow arms in space are reduced
to such an arm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from freefloat.attitude_grids import low_discrepancy
from freefloat.dynamics.arm_factor import ArmPlane
from freefloat.dynamics.denavit_hartenberg import link_frames
from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.plane import plane_of
from freefloat.dynamics.tasks import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError
from freefloat.ik.branches import ClosedForm, closed_form
from freefloat.motion.problem import Problem
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, Pose

Complex = npt.NDArray[np.complex128]
Interval = tuple[float, float]

_GRID = 721
"""Angles per joint, half a degree apart."""


@dataclass(frozen=True, eq=False)
class PlanarArm:
    """A planar arm with revolute joints only; links and inertia refer to zero joints.

    Attributes:
        links: Barycentric vectors of (17) [m], shape (n + 1,): from the centre of mass to the first
            joint, and on to the end-effector.
        inertia: Angular momentum is the sum over j, k of
            ``Re(inertia[j, k] exp(i (phi_k - phi_j))) rate_k``, rates being absolute [kg m²],
            shape (n + 1, n + 1).
        signs: 1 or -1 where a joint's axis points along the plane's normal or against it, (n,).
    """

    links: Complex
    inertia: Complex
    signs: Array

    @classmethod
    def of(cls, model: FreeFloatingModel) -> PlanarArm:
        """The complex form of a robot that stays in a plane, along the axes of that."""
        virtual, plane = VirtualManipulator.of(model), plane_of(model)
        axes = np.eye(3) if plane is None else plane.axes
        rotations = [axes.T]
        for rotation in virtual.rotations:
            rotations.append(rotations[-1] @ rotation)
        return cls(
            links=np.array([_flat(R @ b) for R, b in zip(rotations, virtual.links, strict=True)]),
            inertia=_inertia(model, rotations),
            signs=np.sign(virtual.axes_at(np.zeros(model.dof)) @ axes[:, 2]),
        )

    @property
    def reach(self) -> Interval:
        """Smallest and largest distance of point 3 from the centre of mass [m]."""
        lengths = np.abs(self.links[:3])
        total = float(lengths.sum())
        return max(0.0, 2.0 * float(lengths.max()) - total), total

    def angles(self, heading: npt.ArrayLike, joints: npt.ArrayLike) -> Array:
        """Absolute angles (..., n + 1) from headings (...) and joints (..., n)."""
        relative = np.cumsum(self.signs * np.asarray(joints, dtype=float), axis=-1)
        base = np.asarray(heading, dtype=float)[..., None]
        return np.concatenate(
            [np.broadcast_to(base, (*relative.shape[:-1], 1)), base + relative], -1
        )

    def momentum_coefficients(self, angles: Array) -> Array:
        """The paper's D_j: angular momentum per absolute rate of each link, shape (..., n + 1)."""
        unit = np.exp(1j * angles)
        return np.asarray(np.real(unit * (unit.conj() @ self.inertia)))

    def vectors(self, angles: Array) -> Complex:
        """Barycentric vectors in the inertial frame [m], shape (..., n + 1)."""
        return np.asarray(self.links * np.exp(1j * angles))

    def determinant(self, angles: Array) -> Array:
        """The paper's S of (21a), det A of (5), for two joints, or three at an orientation.

        It concerns the motion of the end of the third barycentric vector, the paper's point 3.
        """
        D, v = self.momentum_coefficients(angles), self.vectors(angles)
        return np.asarray(np.prod(self.signs) * _triple_product(D, v, v))

    def determinant_rate(self, angles: Array, rates: Array) -> Array:
        """dS/dt of :meth:`determinant` for absolute rates [rad/s], shape (..., n + 1)."""
        unit = np.exp(1j * angles)
        unit_rate = 1j * rates * unit
        D, v, v_rate = self.momentum_coefficients(angles), self.links * unit, self.links * unit_rate
        D_rate = np.real(
            unit_rate * (unit.conj() @ self.inertia) + unit * (unit_rate.conj() @ self.inertia)
        )
        S_rate = (
            _triple_product(D_rate, v, v)
            + _triple_product(D, v_rate, v)
            + _triple_product(D, v, v_rate)
        )
        return np.asarray(np.prod(self.signs) * S_rate)

    def rates(self, angles: Array, momentum: float, velocity: Complex, last_rate: Array) -> Array:
        """Solve (24): absolute rates that keep the momentum and move point 3.

        Args:
            angles: Absolute angles, shape (..., n + 1).
            momentum: Angular momentum about z [N m s].
            velocity: Velocity of point 3 [m/s], shape (...).
            last_rate: Angular velocity of the third link [rad/s], shape (...), for arms that have
                one.

        Returns:
            Shape (..., n + 1).
        """
        D, v = self.momentum_coefficients(angles), 1j * self.vectors(angles)
        h = momentum - (D[..., 3] * last_rate if len(self.links) == 4 else 0.0)
        right = np.stack(np.broadcast_arrays(h, velocity.real, velocity.imag), axis=-1)
        matrix = np.stack([D[..., :3], v[..., :3].real, v[..., :3].imag], axis=-2)
        first = np.linalg.solve(matrix, right[..., None])[..., 0]
        if len(self.links) == 3:
            return np.asarray(first)
        last = np.broadcast_to(last_rate, first.shape[:-1])[..., None]
        return np.concatenate([first, last], axis=-1)


def has_two_angle_form(model: FreeFloatingModel, task: Task) -> bool:
    """Whether S of a planar problem depends on the first two joint angles alone."""
    return closed_form(model, task) is ClosedForm.PLANAR_ELBOW


def two_angles(arm: PlanarArm, joints: npt.ArrayLike) -> Array:
    """Absolute angles (..., n + 1) of the first two joints (..., 2), heading and others at zero."""
    q = np.asarray(joints, dtype=float)
    padded = np.concatenate([q, np.zeros((*q.shape[:-1], len(arm.signs) - 2))], axis=-1)
    return arm.angles(np.zeros(q.shape[:-1]), padded)


def point_3(arm: PlanarArm, joints: npt.ArrayLike) -> Complex:
    """Point 3 from the centre of mass at zero heading [m], shape (...), for joints (..., 2)."""
    return np.asarray(arm.vectors(two_angles(arm, joints))[..., :3].sum(axis=-1))


def point_3_on_path(problem: Problem, t: float) -> complex:
    """Point 3 at time t [s] on the path [m]."""
    return point_3_of_pose(problem, problem.path.pose(t))


def point_3_of_pose(problem: Problem, pose: Pose) -> complex:
    """Point 3 for an end-effector pose [m], the end-effector or the joint of the last link (20)."""
    if problem.task is not Task.PLANAR_POSE:
        return _flat(problem.plane.seen(pose.position))
    virtual = VirtualManipulator.of(problem.model)
    return _flat(problem.plane.seen(pose.position - pose.rotation @ virtual.last_link))


def most_singular_place(problem: Problem, angles: int = _GRID) -> tuple[float, float]:
    """The s at which the largest attainable |S| is smallest, and that |S|.

    Configurations form a grid of so many angles of both joints; with the default, half a degree,
    the value is accurate to about one percent.
    """
    arm, axis = PlanarArm.of(problem.model), np.linspace(-np.pi, np.pi, angles)
    joints = np.stack(np.meshgrid(axis, axis), axis=-1)
    S, radii = np.abs(arm.determinant(two_angles(arm, joints))), np.abs(point_3(arm, joints))
    shells = np.linspace(0.0, radii.max(), 401)
    largest = np.zeros(len(shells))
    np.maximum.at(largest, np.ceil(radii / shells[1]).astype(int).clip(max=400), S)
    s = np.linspace(0.0, 1.0, 401)
    poses = [problem.path.pose_at(value) for value in s.tolist()]
    radii_on_path = [abs(point_3_of_pose(problem, pose)) for pose in poses]
    attainable = np.interp(radii_on_path, shells, np.maximum(largest, np.append(largest[1:], 0.0)))
    worst = int(np.argmin(attainable))
    return float(s[worst]), float(attainable[worst])


def _triple_product(D: Array, u: Complex, v: Complex) -> Array:
    """The determinant with the rows D, x of u and y of v, of the first three columns each."""
    return np.asarray((D[..., :3] * np.cross(u[..., :3].real, v[..., :3].imag)).sum(axis=-1))


def _flat(vector: Array) -> complex:
    return complex(vector[0], vector[1])


def _inertia(model: FreeFloatingModel, rotations: list[Array]) -> Complex:
    """Coefficients of the angular momentum, from link vectors to the centres of mass."""
    bodies = model.bodies
    count = len(bodies)
    masses = np.array([body.mass for body in bodies])
    steps = np.zeros((count, count), dtype=complex)  # body i's centre of mass from the root frame
    for i, body in enumerate(bodies):
        if i:
            steps[i] = steps[i - 1]
            steps[i, i - 1] = _flat(rotations[i - 1] @ body.placement.position)
        steps[i, i] = _flat(rotations[i] @ body.centre)
    offsets = steps - masses @ steps / masses.sum()
    moments = [(R @ body.inertia @ R.T)[2, 2] for R, body in zip(rotations, bodies, strict=True)]
    return np.asarray((np.conj(offsets).T * masses) @ offsets + np.diag(moments))


def elbow_arm(model: FreeFloatingModel) -> PlanarArm:
    """The planar arm of two joints, q2 and q3, whose S is the ``arm`` measure (40) of an elbow arm.

    It lies in the plane that the first joint rotates, x across that joint and y along it. Its point
    3 is the wrist centre of the virtual manipulator, at the same distance from the centre of mass.
    Its momentum is the momentum about the normal while the end-effector does not rotate.

    Raises:
        InputError: For arms without that measure, see
            :func:`~freefloat.dynamics.measures.singularity_measure`.
    """
    singularity_measure(model, Task.POSE, "arm")  # refuses other arms
    frames, virtual = link_frames(model), VirtualManipulator.of(model)
    plane = ArmPlane.of(frames)
    D, couplings, vectors = plane.momentum_and_vectors(frames.bodies)
    inertia, above = np.diag(D).astype(complex), np.triu_indices(3, 1)
    inertia[above] = [complex(*coupling) for coupling in couplings]
    inertia.T[above] = inertia[above].conj()
    links = np.array([complex(*vector) for vector in vectors])
    arm = PlanarArm(links, inertia, np.array([1.0, plane.sense]))
    joints = np.pi * (2.0 * low_discrepancy(64, 6) - 1.0)
    positions, rotations, _, _ = virtual.kinematics(joints)
    distances = np.linalg.norm(positions + rotations @ wrist_in_tool(virtual), axis=1)
    if np.abs(np.abs(point_3(arm, joints[:, 1:3])) - distances).max() > 1e-9 * virtual.reach:
        raise InputError(
            "margin.measure", "the first joint changes the wrist's distance from the mass centre",
            "a first joint whose axis passes through the virtual manipulator's base",
        )  # fmt: skip
    return arm


def wrist_in_tool(virtual: VirtualManipulator) -> Array:
    """The virtual manipulator's wrist centre in the end-effector's frame [m], shape (3,)."""
    zero = virtual.pose(np.zeros(6))
    return np.asarray(zero.rotation.T @ (_wrist(virtual) - zero.position))


def _wrist(virtual: VirtualManipulator) -> Array:
    if virtual.wrist_centre is None:
        raise InputError("task", "the wrist is not spherical", "last three axes through one point")
    return virtual.wrist_centre
