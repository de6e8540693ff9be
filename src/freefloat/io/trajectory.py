"""Trajectories: motions sampled at given times, with rates, accelerations and torques."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field, fields, replace
from datetime import UTC, datetime

import numpy as np
import numpy.typing as npt

from freefloat.errors import InputError, finite_number, require_type, whole_number
from freefloat.motion.motion import Ending, Motion
from freefloat.rotations import Rotation
from freefloat.so3 import Array, frozen, without_jumps

MAX_SAMPLES = 1_000_000
"""More samples would fill gigabytes of text."""
J2000 = datetime(2000, 1, 1, 12, tzinfo=UTC)
"""Epoch of motions whose date is not given."""
_MISSED_END = 1e-9
"""Fraction of a step by which the last sample may miss the end."""


@dataclass(frozen=True)
class Header:
    """What files with dates and names state of a trajectory.

    Attributes:
        epoch: Instant of t = 0; UTC where it has no time zone.
        frame: Name of the inertial axes.
        object_name: Name of the spacecraft; None for the name of the robot.
        object_id: Identifier of the spacecraft, such as ``2026-001A``; None for the name.

    Raises:
        InputError: If a name is empty, or has characters that no line of ASCII has.
    """

    epoch: datetime = J2000
    frame: str = "EME2000"
    object_name: str | None = None
    object_id: str | None = None

    def __post_init__(self) -> None:
        require_type("epoch", self.epoch, datetime, "a datetime")
        if self.epoch.tzinfo is None:
            object.__setattr__(self, "epoch", self.epoch.replace(tzinfo=UTC))
        for key in ("frame", "object_name", "object_id"):
            value = getattr(self, key)
            require_type(key, value, str | None, "a text")
            line = value is None or (value.strip() and value.isprintable() and value.isascii())
            if not line:
                raise InputError(key, f"{value!r} was given", "a line of ASCII characters")


HEADER = Header()
"""The header of trajectories without one."""


@dataclass(frozen=True, eq=False)
class Track:
    """Poses of an end-effector."""

    arm: str  # name of its arm; empty for the one on the path of the problem
    positions: Array  # positions from the centre of mass, inertial axes [m], (K, 3)
    orientations: Array  # quaternions x, y, z, w of continuous sign, (K, 4)


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A motion sampled at given times.

    Rates and accelerations follow the motion's law, see :mod:`freefloat.motion.law`: along a
    path the rates solve equation (4), and the accelerations its time derivative; joint
    accelerations of redundant arms and of the task ``pointing`` are central differences of the
    rates. At an end in a dynamic singularity both are NaN.

    Attributes:
        motion: The motion.
        times: Times, rising [s], shape (K,).
        attitudes: Attitudes of the spacecraft, quaternions x, y, z, w of continuous sign, (K, 4).
        base_positions: Positions of the root link from the centre of mass, even where that
            drifts, inertial axes [m], shape (K, 3).
        base_velocities: Velocities of the same point, inertial axes [m/s], shape (K, 3).
        angular_velocities: Angular velocities of the spacecraft, inertial axes [rad/s], (K, 3).
        joints: Joint values [rad or m], shape (K, n).
        joint_rates: Joint rates [rad/s or m/s], shape (K, n).
        joint_accelerations: Joint accelerations [rad/s² or m/s²], shape (K, n).
        joint_torques: Joint torques of inverse dynamics [N m or N], shape (K, n).
        end_effectors: Poses of the end-effectors of all arms that move, the one on the path of
            the problem first.
        centre_of_mass_positions: Positions of the centre of mass, path's frame [m], shape (K, 3).
        measure: Signed singularity measure of the margin, shape (K,).
        header: What files with dates and names state.
        feasible: Whether the answer that has the motion is feasible; None for a motion alone.
        reason: Why, in the words of the answer.
    """

    motion: Motion = field(repr=False)
    times: Array
    attitudes: Array
    base_positions: Array
    base_velocities: Array
    angular_velocities: Array
    joints: Array
    joint_rates: Array
    joint_accelerations: Array
    joint_torques: Array
    end_effectors: tuple[Track, ...]
    centre_of_mass_positions: Array
    measure: Array
    header: Header = field(default=HEADER, repr=False)
    feasible: bool | None = None
    reason: str = ""

    def __post_init__(self) -> None:
        for entry in fields(self):
            value = getattr(self, entry.name)
            if isinstance(value, np.ndarray):
                object.__setattr__(self, entry.name, frozen(value))

    @classmethod
    def sampled(
        cls,
        motion: Motion,
        count: int | None = None,
        rate: float | None = None,
        header: Header = HEADER,
    ) -> Trajectory:
        """Sample a motion at evenly spaced times: a number of them, by default 501, or a rate [Hz].

        Raises:
            InputError: If both are given, or there would be fewer than two or too many times.
        """
        if rate is None:
            times = even_times(motion, 501 if count is None else count)
            return cls.of(motion, times, header)
        if count is not None:
            raise InputError("rate", "a number of times was given, too", "one of the two")
        return cls.of(motion, times_at_rate(motion, rate), header)

    @classmethod
    def of(cls, motion: Motion, times: npt.ArrayLike, header: Header = HEADER) -> Trajectory:
        """Sample a motion at times, rising [s], shape (K,).

        Raises:
            InputError: If a time lies outside the motion.
        """
        _, attitudes, joints = motion.evaluate(motion.coordinates_at(times))
        times = np.atleast_1d(np.asarray(times, dtype=float))
        if not times.size:
            raise InputError("times", "none was given", "one time [s] or more")
        setting, model = motion.setting, motion.model
        n = model.dof
        effort = motion.law.effort(times, attitudes, joints)
        efforts = np.hstack([effort.rates, effort.accelerations[:, 6:], effort.joint_torques])
        if motion.ending is Ending.SINGULAR:
            efforts[times == motion.final.time] = np.nan
        parts = np.split(efforts, [3, 6, 6 + n, 6 + 2 * n], axis=1)
        base, angular, rates, accelerations, torques = parts
        base_axes = Rotation.from_quat(attitudes)
        bodies = model.body_poses(attitudes, joints)
        links = {"": model.end_effector_link, **model.further_arms}
        places = ((arm, *model.link_places[link]) for arm, link in links.items())
        poses = ((arm, bodies[number] @ place) for arm, number, place in places)
        tracks = [Track(arm, p.position, frozen(without_jumps(p.quaternion))) for arm, p in poses]
        return cls(
            motion=motion,
            times=times,
            attitudes=without_jumps(attitudes),
            base_positions=model.base_position(attitudes, joints),
            base_velocities=base_axes.apply(base),
            angular_velocities=base_axes.apply(angular),
            joints=joints,
            joint_rates=rates,
            joint_accelerations=accelerations,
            joint_torques=torques,
            end_effectors=tuple(tracks),
            centre_of_mass_positions=np.outer(times, setting.drift),
            measure=setting.margin.measure(joints),
            header=header,
        )

    @property
    def displaced(self) -> bool:
        """Whether the centre of mass is elsewhere than at the origin of the path's frame."""
        return bool(self.centre_of_mass_positions.any())

    def later(self, start: float, centre: Array) -> Trajectory:
        """The trajectory in the time and frame of a manoeuvre.

        It begins there at a time [s], with the centre of mass at a place [m], shape (3,).
        """
        centres = self.centre_of_mass_positions + centre
        return replace(self, times=self.times + start, centre_of_mass_positions=centres)


def even_times(motion: Motion, count: int) -> Array:
    """Evenly spaced times from the first to the last of a motion [s], shape (count,).

    A motion that ends where it begins has a single time.

    Raises:
        InputError: If there are fewer than two or too many.
    """
    count = whole_number("times", count, 2, MAX_SAMPLES)
    first, last = _span(motion)
    steps = count - 1 if last > first else 0
    times = first + np.arange(steps + 1) * (last - first) / max(1, steps)  # 99.8, not 99.80...01
    return np.append(times[:-1], last)


def times_at_rate(motion: Motion, rate: float) -> Array:
    """Times at a fixed rate [Hz], and the last time of the motion [s], shape (K,).

    Raises:
        InputError: If there would be too many, or the rate is not positive.
    """
    first, last = _span(motion)
    accepted = f"above 0 Hz, and {MAX_SAMPLES:,} times at most in {last - first:g} s"
    rate = finite_number("rate", rate, accepted, sys.float_info.min)
    whole = rate * (last - first)
    if whole > MAX_SAMPLES - 2:
        raise InputError("rate", f"{rate:g} Hz was given", accepted)
    steps = np.ceil(whole * (1.0 - _MISSED_END))
    return np.append(first + np.arange(steps) / rate, last)


def _span(motion: Motion) -> tuple[float, float]:
    return float(motion.times.min()), float(motion.times.max())
