"""Rates and forces with the deviations of their grade."""

import numpy as np
import pytest

from rigs.walled_room import ROOM, state
from volery.ros.messages import new
from volery.simulation.added_sensors.external_imu import ExternalImu
from volery.simulation.world.sensors import ErrorModel


def test_it_reads_rates_and_forces_with_errors_of_their_own():
    imu = ExternalImu("imu_external", 200.0, ErrorModel(0.01), ErrorModel(0.5))
    sampler = imu.sampler(np.uint64(3), ROOM)
    true = state((0.0, 0.0, 1.5))._replace(rates=(0.1, 0.2, 0.3), specific_force=(0.0, 1.0, 9.8))
    found = np.array([sampler(true, k) for k in range(2000)])
    assert found.mean(axis=0) == pytest.approx([0.1, 0.2, 0.3, 0.0, 1.0, 9.8], abs=0.05)
    assert found.std(axis=0) == pytest.approx([0.01] * 3 + [0.5] * 3, rel=0.1)
    assert abs(np.corrcoef(found.T) - np.eye(6)).max() < 0.1


def test_a_message_of_it():
    message = new("sensor_msgs/msg/Imu")
    ExternalImu("imu_external", 200.0).fill(message, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
    assert (message.angular_velocity.y, message.linear_acceleration.z) == (2.0, 6.0)
    assert message.orientation_covariance[0] == -1.0
    assert message.angular_velocity_covariance[4] > 0.0
