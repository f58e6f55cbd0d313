"""A cone reads the nearest return within: one number, with one error."""

from math import cos, inf, radians

import numpy as np
import pytest

from rigs.walled_room import ROOM, box, state
from volery.base.frames import euler_to_quaternion
from volery.ros.messages import new
from volery.simulation.added_sensors.beams import Ranging
from volery.simulation.added_sensors.cone_ranger import INFRARED, ULTRASOUND, ConeRanger
from volery.simulation.world.scene import Scene
from volery.simulation.world.sensors import Mounting

DOWN = Mounting((0.0, 0.0, 0.0), euler_to_quaternion(0.0, radians(90.0), 0.0))


def cone(degrees, mounting=None):
    return ConeRanger("sonar", 10.0, Ranging(0.1, 20.0), radians(degrees), ULTRASOUND, mounting=mounting)


def read(sensor, scene=ROOM, **angles):
    (found,) = sensor.sampler(np.uint64(0), scene)(state((0.0, 0.0, 1.5), scene=scene, **angles), 0)
    return found


def test_a_range_finder_looks_down_and_tilts_with_the_body():
    assert read(cone(0.001, DOWN)) == pytest.approx(1.5, abs=1e-4)
    assert read(cone(0.001, DOWN), roll=0.3) == pytest.approx(1.5 / cos(0.3), abs=1e-3)
    assert read(cone(60.0, DOWN), roll=0.3) == pytest.approx(
        1.5, abs=0.05
    )  # the cone still holds what is below


def test_the_nearest_return_in_the_cone_counts():
    post = Scene([box("post", 3.0, 0.45, 3.2, 0.6)])
    assert read(cone(2.0), post) == inf
    assert 3.0 < read(cone(20.0), post) < 3.1
    assert read(cone(2.0), post, yaw=0.17) == pytest.approx(3.04, abs=0.02)


def test_a_message_of_it():
    message = new("sensor_msgs/msg/Range")
    sensor = ConeRanger("range", 20.0, Ranging(0.2, 30.0), radians(2.0), INFRARED)
    sensor.fill(message, np.array([2.5]))
    assert (message.radiation_type, message.min_range, message.max_range) == (INFRARED, 0.2, 30.0)
    assert (message.range, message.field_of_view) == (2.5, pytest.approx(0.0349, abs=1e-4))
