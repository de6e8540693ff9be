"""Attitudes of the spacecraft as an Attitude Ephemeris Message, CCSDS 504.0-B-1."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from freefloat.errors import InputError
from freefloat.io.trajectory import Trajectory


def attitude_ephemeris_text(trajectory: Trajectory) -> str:
    """Text of an Attitude Ephemeris Message in keyword-value notation.

    Frame A are the inertial axes, under the name of the header; frame B are the axes of the
    spacecraft. The quaternion of the transformation from A to B has its scalar part last, as ours,
    and describes the rotation that takes the axes of A to the axes of B: it is our attitude.

    Raises:
        InputError: If the name of the robot is not in ASCII and no other one is given, or a date is
            beyond the year 9999.
    """
    times = [_date(trajectory, t) for t in trajectory.times.tolist()]
    header = trajectory.header
    robot = trajectory.motion.model.description.name
    name = header.object_name or robot or "SPACECRAFT"
    if not name.isascii():
        accepted = "a name in ASCII characters, which the format asks for"
        raise InputError("object_name", f"the robot's is {name!r}", accepted)
    rows = [
        f"{time} {x:.15f} {y:.15f} {z:.15f} {w:.15f}"
        for time, (x, y, z, w) in zip(times, trajectory.attitudes.tolist(), strict=True)
    ]
    lines = [
        "CCSDS_AEM_VERS = 1.0",
        f"CREATION_DATE = {datetime.now(UTC):%Y-%m-%dT%H:%M:%S}",
        "ORIGINATOR = FREEFLOAT",
        "META_START",
        f"OBJECT_NAME = {name}",
        f"OBJECT_ID = {header.object_id or name}",
        f"REF_FRAME_A = {header.frame}",
        "REF_FRAME_B = SC_BODY_1",
        "ATTITUDE_DIR = A2B",
        "TIME_SYSTEM = UTC",
        f"START_TIME = {times[0]}",
        f"STOP_TIME = {times[-1]}",
        "ATTITUDE_TYPE = QUATERNION",
        "QUATERNION_TYPE = LAST",
        "META_STOP",
        "DATA_START",
        *rows,
        "DATA_STOP",
    ]
    return "\n".join(lines) + "\n"


def _date(trajectory: Trajectory, t: float) -> str:
    """Date of a time [s], to a nanosecond."""
    nanoseconds, epoch = round(t * 1e9), trajectory.header.epoch
    try:
        whole = epoch.astimezone(UTC) + timedelta(seconds=nanoseconds // 10**9 + 1)
    except OverflowError:
        raise InputError("epoch", f"{epoch} was given", "years 1 to 9999 at all times") from None
    whole -= timedelta(seconds=1)
    fraction = whole.microsecond * 1000 + nanoseconds % 10**9
    whole = whole.replace(microsecond=0) + timedelta(seconds=fraction // 10**9)
    return f"{whole:%Y-%m-%dT%H:%M:%S}.{fraction % 10**9:09d}"
