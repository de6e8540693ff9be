"""The largest joint torques along many recorded motions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.polynomial import chebyshev

from freefloat.dynamics.link_frames import frames_at_zero, in_frame, joints_at_zero
from freefloat.ensemble.recorded_motions import RecordedMotions, in_panels
from freefloat.ensemble.robots import Robots
from freefloat.motion.panels import DEGREE, TO_COEFFICIENTS
from freefloat.so3 import Array

_POINTS = np.linspace(-1.0, 1.0, 65)
_TO_POINTS = chebyshev.chebvander(_POINTS, DEGREE) @ TO_COEFFICIENTS
"""Maps values at the nodes of a panel to values at evenly spaced parameters."""
_LAST = 3
"""Number of last Chebyshev coefficients from which the interpolation error is estimated."""


class LargestTorques(NamedTuple):
    """The largest magnitude of the torque or force of each joint along K motions.

    Attributes:
        values: The magnitudes [N m or N], shape (K, n).
        times: Their times [s], shape (K, n).
        errors: Estimated errors of the magnitudes, shape (K, n).
    """

    values: Array
    times: Array
    errors: Array


def largest_torques(recorded: RecordedMotions, threads: int) -> LargestTorques:
    """The largest torques along recorded motions of robots with one moving arm.

    Torques depend on the states and their derivatives by time, those of the panels' polynomials.
    The acceleration of the base is the one without an external force.
    """
    torques = _torques(recorded, threads)
    shown = np.abs(_TO_POINTS @ torques)  # (K, P, 65, n)
    count, _, points, n = shown.shape
    rows = np.arange(count)[:, None]
    best = shown.reshape(count, -1, n).argmax(axis=1)
    panel, point = np.divmod(best, points)
    middle, joint = np.clip(point, 1, points - 2), np.arange(n)
    before, at, after = (shown[rows, panel, middle + k, joint] for k in (-1, 0, 1))
    bend = before - 2.0 * at + after
    with np.errstate(divide="ignore", invalid="ignore"):
        place = np.where(bend < 0.0, 0.5 * (before - after) / bend, 0.0)
    inside = np.abs(place) <= 1.0
    top = np.where(inside, at - 0.25 * (before - after) * place, 0.0)
    values = np.maximum(shown[rows, panel, point, joint], top)
    x = np.where(inside, middle + place, point) / (points - 1)
    edges = recorded.panel_times[rows, panel]
    times = edges[..., 0] + x * (edges[..., -1] - edges[..., 0])
    last = np.abs((TO_COEFFICIENTS @ torques)[:, :, -_LAST:]).sum(axis=2)
    return LargestTorques(values, times, last.max(axis=1))


def _torques(recorded: RecordedMotions, threads: int) -> Array:
    """Joint torques at the nodes of panels, shape (K, P, 9, n)."""
    joints, attitudes = in_panels(recorded.joints), in_panels(recorded.attitudes)
    rates, slopes = recorded.rates(joints), recorded.rates(attitudes)
    x, w, dx, dw = attitudes[..., :3], attitudes[..., 3:], slopes[..., :3], slopes[..., 3:]
    omega = 2.0 * (w * dx - dw * x - np.cross(x, dx))
    still = np.zeros_like(omega)  # torques do not depend on the velocity of the base
    velocities = still, omega, rates
    accelerations = still, recorded.rates(omega), recorded.rates(rates)
    each = (still, attitudes, joints), velocities, accelerations
    states = [np.concatenate(parts, axis=-1) for parts in each]
    disturbed = recorded.disturbed
    model, robots = disturbed.problem.model, disturbed.systems.robots
    threads = threads if robots is None else 1  # those that wait for others would take time
    free = slice(2 if model.on_table else 3)  # the base does not rise from a table
    pool = pin.ModelPool(model.pin_model, threads)
    torques = np.empty(joints.shape)
    every = [slice(None)] if robots is None else [slice(k, k + 1) for k in range(len(joints))]
    masses = np.full(len(joints), sum(body.mass for body in model.bodies))
    inertias: Iterator[list[pin.Inertia]] = iter(())
    if robots is not None:
        inertias, masses = _inertias(robots), robots.total_masses
    for some in every:
        for number, inertia in enumerate(next(inertias, []), 1):
            pool.getModel(0).inertias[number] = inertia
        q, v, a = (np.asfortranarray(rows[some].reshape(-1, rows.shape[-1]).T) for rows in states)
        a[free] = -pin.rneaInParallel(threads, pool, q, v, a)[free] / masses[some][0]
        forces = pin.rneaInParallel(threads, pool, q, v, a)
        torques[some] = forces[6:].T.reshape(torques[some].shape)
    return torques * disturbed.factors[:, None, None, None]


def _inertias(robots: Robots) -> Iterator[list[pin.Inertia]]:
    """Yield the inertias of the bodies of each robot in Pinocchio's frames."""
    frames, (_, points, rotations) = frames_at_zero(robots.frames), joints_at_zero(robots.nominal)
    origins = np.vstack([np.zeros(3), points])[: len(frames)]
    turns = np.stack([np.eye(3), *rotations])[: len(frames)].swapaxes(1, 2)
    positions = (turns @ (frames[:, 3] - origins)[..., None])[..., 0]
    rows = in_frame(robots.bodies, turns @ frames[:, :3].swapaxes(1, 2), positions)
    masses = rows[..., 0]
    centres = rows[..., 1:4] / np.where(masses > 0.0, masses, 1.0)[..., None]
    about = in_frame(rows, np.eye(3), -centres)[..., [4, 9, 8, 9, 5, 7, 8, 7, 6]]
    about = about.reshape(*masses.shape, 3, 3)
    for robot in zip(masses.tolist(), centres, about, strict=True):
        yield [pin.Inertia(*body) for body in zip(*robot, strict=True)]
