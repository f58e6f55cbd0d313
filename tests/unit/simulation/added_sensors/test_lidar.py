"""The message of a planar scan."""

from math import inf, pi, radians

import numpy as np
import pytest

from rigs.walled_room import NORTH, ROOM, WEST, lidar, state
from volery.base.errors import UsageError
from volery.ros.messages import new
from volery.simulation.added_sensors.beams import Ranging
from volery.simulation.added_sensors.lidar import RingLidar


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


def test_a_cloud_has_a_point_for_each_beam_in_the_frame_of_the_sensor():
    sensor = RingLidar("lidar3d", 10.0, Ranging(0.1, 30.0), 3, 8, radians(-30.0), radians(30.0))
    found = sensor.sampler(np.uint64(0), ROOM)(state((0.0, 0.0, 1.5), yaw=pi / 2), 0)
    message = new("sensor_msgs/msg/PointCloud2")
    sensor.fill(message, found)
    assert (message.height, message.width, message.point_step, message.row_step) == (3, 8, 16, 128)
    offsets = {one.name: one.offset for one in message.fields}
    assert offsets == {"x": 0, "y": 4, "z": 8, "ring": 12}
    raw = np.asarray(message.data, np.uint8).reshape(3, 8, 16)
    x, y, z = (raw[..., at : at + 4].copy().view("<f4")[..., 0] for at in (0, 4, 8))
    rings = raw[..., 12:14].copy().view("<u2")[..., 0]
    assert (rings == [[0], [1], [2]] * np.ones((1, 8))).all()
    assert (x[1, 4], y[1, 4]) == pytest.approx((NORTH, 0.0), abs=1e-5)  # it looks north
    assert (x[1, 6], y[1, 6]) == pytest.approx((0.0, -WEST), abs=1e-5)
    assert z[0] == pytest.approx(-1.5, abs=1e-4)  # the floor
    assert np.isnan(x[2]).any()  # over the walls
    assert not message.is_dense


def test_wrong_rings_are_refused():
    with pytest.raises(UsageError, match="the lower angle first"):
        RingLidar("lidar3d", 10.0, Ranging(0.1, 30.0), 3, 8, 0.1, 0.0)
