"""The message of a planar scan."""

from math import inf, pi, radians

import numpy as np
import pytest

from rigs.walled_room import ROOM, lidar, state
from volery.base.errors import UsageError
from volery.ros.messages import new
from volery.simulation.added_sensors.beams import Ranging


@pytest.mark.parametrize(("field", "columns"), [(2.0 * pi, 360), (radians(270.0), 1081)])
def test_the_angles_of_a_scan_are_those_of_its_beams(field, columns):
    sensor = lidar(columns, field, Ranging(0.1, 8.0))
    message = new("sensor_msgs/msg/LaserScan")
    sensor.fill(message, sensor.sampler(np.uint64(0), ROOM)(state((0.0, 0.0, 1.5)), 0))
    assert (message.range_min, message.range_max) == (0.1, 8.0)
    assert len(message.ranges) == columns
    assert message.angle_min + (columns - 1) * message.angle_increment == pytest.approx(message.angle_max)
    angles = message.angle_min + message.angle_increment * np.arange(columns)
    np.testing.assert_allclose(sensor.beams()[:, 0], np.cos(angles), atol=1e-9)
    np.testing.assert_allclose(sensor.beams()[:, 1], np.sin(angles), atol=1e-9)
    ahead = int(np.argmin(abs(angles)))
    assert message.ranges[ahead] == inf  # ten metres away
    left = int(np.argmin(abs(angles - pi / 2)))
    assert message.ranges[left] == pytest.approx(5.0, abs=1e-3)


def test_too_few_beams_are_refused():
    with pytest.raises(UsageError, match="at least two"):
        lidar(1)
