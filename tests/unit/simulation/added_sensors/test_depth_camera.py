"""Depths along the axis of a camera, in a frame right, down, ahead."""

from math import inf, pi, radians

import numpy as np
import pytest

from rigs.walled_room import EAST, ROOM, SOUTH, state
from volery.base.errors import UsageError
from volery.base.frames import body_to_world
from volery.ros.messages import new
from volery.simulation.added_sensors.beams import Ranging
from volery.simulation.added_sensors.depth_camera import OPTICAL, DepthCamera
from volery.simulation.world.sensors import Mounting

CAMERA = DepthCamera(
    "depth_camera", 15.0, Ranging(0.1, 20.0), 21, 11, pi / 2, mounting=Mounting((0.0, 0.0, 0.0), OPTICAL)
)


def seen(camera=CAMERA, **angles):
    values = camera.sampler(np.uint64(0), ROOM)(state((0.0, 0.0, 1.5), **angles), 0)
    message = new("sensor_msgs/msg/Image")
    camera.fill(message, values)
    assert (message.encoding, message.step, message.height) == ("32FC1", 4 * camera.width, camera.height)
    return np.asarray(message.data, np.uint8).view("<f4").reshape(message.height, message.width)


def test_its_frame_is_right_down_ahead():
    assert body_to_world(OPTICAL, (0.0, 0.0, 1.0)) == pytest.approx((1.0, 0.0, 0.0))
    assert body_to_world(OPTICAL, (1.0, 0.0, 0.0)) == pytest.approx((0.0, -1.0, 0.0))
    assert body_to_world(OPTICAL, (0.0, 1.0, 0.0)) == pytest.approx((0.0, 0.0, -1.0))
    assert CAMERA.frame == "depth_camera_optical_frame"


def test_a_flat_wall_has_one_depth():
    depths = seen(yaw=-pi / 2)  # towards the south
    assert depths[5] == pytest.approx(np.full(21, -SOUTH), abs=1e-5)
    assert (depths[10] < -SOUTH).all()  # the floor
    assert (depths[0] == inf).all()  # over the wall


def test_depths_and_calibration_are_those_of_points():
    info = new("sensor_msgs/msg/CameraInfo")
    CAMERA.fill_info(info, None)
    focal, centre_x, centre_y = info.k[0], info.k[2], info.k[5]
    depths = seen()
    row, column = 6, 2  # left of the axis, a little below
    right = (column - centre_x) * depths[row, column] / focal
    down = (row - centre_y) * depths[row, column] / focal
    assert right == pytest.approx(-5.0, abs=1e-4)  # on the northern wall
    assert down == pytest.approx(0.1 * depths[row, column], abs=1e-4)
    assert depths[5, 10] == pytest.approx(EAST)
    assert [one.topic for one in CAMERA.publications()] == ["depth/image_rect", "depth/camera_info"]


def test_wrong_sizes_are_refused():
    with pytest.raises(UsageError, match="over less than"):
        DepthCamera("c", 15.0, Ranging(0.1, 20.0), 21, 11, radians(180.0))
