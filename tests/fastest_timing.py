"""The fastest timing of a joint path by toppra."""

import numpy as np
import pinocchio as pin
import toppra
from scipy.interpolate import CubicSpline
from toppra import algorithm, constraint

import freefloat as ff


def torque_of(model):
    """Joint torques of the drifting arm at rest in momentum, by Pinocchio's matrices alone."""
    pinocchio = model.pin_model.copy()
    pinocchio.gravity = pin.Motion.Zero()
    data = pinocchio.createData()

    def torques(q, rates, accelerations):
        configuration = model.configuration([0.0, 0.0, 0.0, 1.0], q)
        M = pin.crba(pinocchio, data, configuration)
        M = np.triu(M) + np.triu(M, 1).T
        base = -np.linalg.solve(M[:6, :6], M[:6, 6:] @ rates)
        v = np.concatenate([base, rates])
        bias = pin.rnea(pinocchio, data, configuration, v, np.zeros(len(v)))
        a = -np.linalg.solve(M[:6, :6], M[:6, 6:] @ accelerations + bias[:6])
        forces = pin.rnea(pinocchio, data, configuration, v, np.concatenate([a, accelerations]))
        return np.asarray(forces[6:])

    return torques


def toppra_duration(motion, limits: ff.Limits) -> float:
    """The duration that toppra finds for the same joint path, without limits of jerks."""
    timing = motion.problem.path.timing
    times = np.linspace(0.0, timing.duration, 3001)
    s, kept = np.unique(timing.s(times), return_index=True)
    joints = motion.evaluate(motion.coordinates_at(times[kept]))[2]
    dense = np.linspace(0.0, 1.0, 401)
    spline = toppra.SplineInterpolator(dense, CubicSpline(s, joints)(dense))
    rates, torques, accelerations = (
        None if bound is None else np.column_stack([-bound, bound])
        for bound in (limits.joint_rate, limits.joint_torque, limits.joint_acceleration)
    )
    bounds, between = (
        [constraint.JointVelocityConstraint(rates)],
        {"discretization_scheme": constraint.DiscretizationType.Interpolation},
    )
    if torques is not None:
        friction, torque = np.zeros(joints.shape[1]), torque_of(motion.problem.model)
        bounds.append(constraint.JointTorqueConstraint(torque, torques, friction, **between))
    if accelerations is not None:
        bounds.append(constraint.JointAccelerationConstraint(accelerations, **between))
    solver = algorithm.TOPPRA(bounds, spline, gridpoints=np.linspace(0.0, 1.0, 1001))
    return float(solver.compute_trajectory(0.0, 0.0).duration)
