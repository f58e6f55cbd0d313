"""A planar scan: where its beams ended, in the frame of the vehicle."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from volery.autonomy.planar_pose import Array, Pose2
from volery.base.errors import UsageError
from volery.base.metered_work import done
from volery.base.time import Ns


class LaserScan2(NamedTuple):
    """The beams of a scan that say something.

    Args:
        time: Time of the scan [ns].
        points: Ends of the beams that met something, in their order (n, 2) [m].
        open_ends: Ends of those that met nothing within the range of the sensor (m, 2) [m].
    """

    time: Ns
    points: Array
    open_ends: Array


def scan_of(message: Any, mounting: Pose2 = Pose2()) -> LaserScan2:  # noqa: B008  # it is immutable
    """Return the scan of a ``sensor_msgs/LaserScan``.

    By REP 117 a range of infinity met nothing, and one of minus infinity or that is no number says nothing;
    one below the least range of the message says nothing, either. Drivers that give their largest range in
    place of infinity are understood: from 99.9 % of ``range_max`` on nothing was met.

    Args:
        message: The message.
        mounting: Pose of the sensor in the vehicle's frame.

    Raises:
        UsageError: The message states no usable angles or limits.
    """
    ranges: Array = np.asarray(message.ranges, dtype=np.float64)
    least, most = float(message.range_min), float(message.range_max)
    step = float(message.angle_increment)
    if not (
        np.isfinite((least, most, step, message.angle_min)).all() and 0.0 <= least < most and step != 0.0
    ):
        raise UsageError(
            f"a LaserScan from {least} to {most} m in steps of {step} rad; give finite limits in order"
        )
    angles: Array = float(message.angle_min) + step * np.arange(len(ranges), dtype=np.float64)
    stamp = message.header.stamp
    seconds, rest = (stamp.sec, stamp.nanosec) if hasattr(stamp, "sec") else (stamp.secs, stamp.nsecs)
    return scan_from_ranges(seconds * 1_000_000_000 + rest, angles, ranges, least, most, mounting)


def scan_from_ranges(
    time: Ns,
    angles: Array,
    ranges: Array,
    least: float,
    most: float,
    mounting: Pose2 = Pose2(),  # noqa: B008
) -> LaserScan2:
    """Return a scan of ranges [m] at angles [rad], as of ``scan_of``."""
    done("scan", beams=len(ranges))
    with np.errstate(invalid="ignore"):
        met = (ranges >= least) & (ranges < 0.999 * most)
        nothing = ranges >= 0.999 * most
    beams = np.stack((np.cos(angles), np.sin(angles)), axis=1)
    return LaserScan2(time, mounting.of(beams[met] * ranges[met, None]), mounting.of(beams[nothing] * most))
