from __future__ import annotations

from math import inf, nan, pi

import numpy as np
import pytest

from volery.autonomy.laser_scan import scan_of
from volery.autonomy.planar_pose import Pose2
from volery.base.errors import UsageError
from volery.ros.messages import new


def message(ranges: list[float]) -> object:
    made = new("sensor_msgs/msg/LaserScan")
    made.angle_min, made.angle_increment, made.range_min, made.range_max = 0.0, pi / 2, 0.1, 10.0
    made.ranges = ranges
    made.header.stamp.sec, made.header.stamp.nanosec = 3, 5
    return made


def test_what_ranges_say_by_rep_117() -> None:
    scan = scan_of(message([2.0, inf, -inf, nan]))
    assert scan.time == 3_000_000_005
    assert scan.points == pytest.approx(np.array([[2.0, 0.0]]))
    assert scan.open_ends == pytest.approx(np.array([[0.0, 10.0]]), abs=1e-6)


def test_ranges_at_the_limit_met_nothing_and_below_it_are_left_out() -> None:
    scan = scan_of(message([0.05, 10.0, 9.995, 12.0]))
    assert len(scan.points) == 0
    assert len(scan.open_ends) == 3


def test_a_sensor_that_is_mounted_to_the_left() -> None:
    scan = scan_of(message([2.0]), Pose2(0.2, 0.0, pi / 2))
    assert scan.points == pytest.approx(np.array([[0.2, 2.0]]))


def test_a_scan_without_usable_angles_is_refused() -> None:
    made = message([1.0])
    made.angle_increment = 0.0  # type: ignore[attr-defined]
    with pytest.raises(UsageError, match="LaserScan"):
        scan_of(made)
