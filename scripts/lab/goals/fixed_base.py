"""Joint paths of RRT-Connect for a spacecraft at rest, and where they lead when it drifts."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from ompl import base, geometric, util

from freefloat.so3 import Array, Pose
from goals.queries import IDENTITY, Query, drifted

_LONGEST = 20.0
"""Time for a path [s]."""
_STEP = 0.02
"""Distance of configurations that are checked [rad]."""


@dataclass(frozen=True)
class FixedBasePath:
    """A joint path for a spacecraft that does not move.

    Attributes:
        joints: Joint values at steps of 0.02 rad, shape (K, n); None if none was found.
        seconds: Processor time [s].
    """

    joints: Array | None
    seconds: float

    def drifting_clearance(self, query: Query) -> float:
        """Smallest distance beyond the clearance when the spacecraft drifts [m]."""
        states = zip(drifted(query, self.joints), self.joints, strict=True)
        return min(query.clearance(*state) for state in states)

    def drifting_error(self, query: Query) -> float:
        """Distance of the end-effector from where it would be if nothing drifted [m]."""
        model, last = query.system.model, self.joints[-1]
        end = model.end_effector_pose(drifted(query, self.joints)[-1], last).position
        fixed = model.end_effector_pose(IDENTITY, last).position + _shift(query, last)
        return float(np.linalg.norm(end - fixed))


def plan_with_fixed_base(query: Query) -> FixedBasePath:
    """Plan from the start to the configuration at the goal of a query."""
    model = query.system.model
    space, bounds = base.RealVectorStateSpace(model.dof), base.RealVectorBounds(model.dof)
    low, high = (np.clip(ends, -2.0 * np.pi, 2.0 * np.pi) for ends in model.joint_ranges)
    for k in range(model.dof):
        bounds.setLow(k, float(low[k]))
        bounds.setHigh(k, float(high[k]))
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(lambda state: _clear(query, _values(state, model.dof)))
    information = setup.getSpaceInformation()
    information.setStateValidityCheckingResolution(_STEP / space.getMaximumExtent())
    setup.setPlanner(geometric.RRTConnect(information))
    ends = [space.allocState(), space.allocState()]
    for state, values in zip(ends, (query.joints, query.end), strict=True):
        for k, value in enumerate(values.tolist()):
            state[k] = value
    setup.setStartAndGoalStates(*ends)
    util.setLogLevel(util.LogLevel.LOG_ERROR)
    begin = time.process_time()
    setup.solve(_LONGEST)
    seconds = time.process_time() - begin
    if not setup.haveExactSolutionPath():
        return FixedBasePath(None, seconds)
    setup.simplifySolution()
    path = setup.getSolutionPath()
    path.interpolate(max(2, int(path.length() / _STEP)))
    seconds = time.process_time() - begin
    return FixedBasePath(np.array([_values(s, model.dof) for s in path.getStates()]), seconds)


def _values(state: base.State, count: int) -> Array:
    return np.array([state[k] for k in range(count)])


def _clear(query: Query, joints: Array) -> bool:
    """Whether a configuration keeps the clearance while the spacecraft is where it was."""
    if query.pairs is None:
        return True
    shift = _shift(query, joints)
    poses = [Pose(body.position - shift, body.orientation) for body in query.scene.bodies]
    every = np.arange(len(query.pairs.pairs))
    distances = query.pairs.distances(joints, every, IDENTITY, poses)
    return float(distances.min()) > query.limits.clearance


def _shift(query: Query, joints: Array) -> Array:
    """Displacement of the robot that brings the spacecraft back to its place at the start [m]."""
    first, now = (query.system.model.body_poses(IDENTITY, q)[0] for q in (query.joints, joints))
    return np.asarray(first.position - now.position)
