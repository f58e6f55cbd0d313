"""Readings of beams: limits by REP 117, noise by seed and step, lost returns, and how the body tilts them."""

from math import cos, inf, sin

import numpy as np
import pytest

from rigs.walled_room import EAST, NORTH, ROOM, SOUTH, WEST, lidar, state
from volery.base.errors import UsageError
from volery.base.frames import LocalFrame
from volery.base.time import MS
from volery.simulation.added_sensors.beams import Ranging
from volery.simulation.world.body_specs import Multirotor
from volery.simulation.world.world import World


def to_wall(angle):
    """The distance from the origin to the walls of the room, along an angle from east."""
    east, north = cos(angle), sin(angle)
    across = (EAST if east > 0.0 else WEST) / east if east else inf
    along = (NORTH if north > 0.0 else SOUTH) / north if north else inf
    return min(across, along)


def read(sensor, *angles, position=(0.0, 0.0, 1.5), noise=0, k=0):
    return sensor.sampler(np.uint64(noise), ROOM)(state(position, *angles), k)


def test_the_ranges_in_a_room_are_those_of_geometry():
    sensor = lidar(360)
    expected = [to_wall(sensor.first + index * sensor.between + 0.3) for index in range(360)]
    np.testing.assert_allclose(read(sensor, 0.0, 0.0, 0.3), expected, atol=1e-9)


def test_the_beams_begin_where_the_sensor_is_mounted():
    ahead, left, _, right = read(lidar(4, at=(0.5, 0.25, 0.0)))[[2, 3, 0, 1]]
    assert (ahead, left, right) == pytest.approx((EAST - 0.5, NORTH - 0.25, -SOUTH + 0.25))


def test_the_beams_tilt_with_the_body():
    pitch = 0.1  # nose down
    found = read(lidar(4), 0.0, pitch, 0.0)
    assert found[2] == pytest.approx(min(EAST / cos(pitch), 1.5 / sin(pitch)))
    assert found[0] == pytest.approx(-WEST / cos(pitch))  # rises to 2.1 m, below the top of the wall
    steep = read(lidar(4), 0.0, 0.3, 0.0)
    assert steep[2] == pytest.approx(1.5 / sin(0.3), abs=1e-4)  # meets the floor
    assert steep[0] == inf  # over the wall, whose top is at 3 m
    assert read(lidar(4), 0.2)[1] == pytest.approx(-SOUTH / cos(0.2))  # right side down


def test_readings_beyond_the_limits_are_infinite():
    found = read(lidar(4, ranging=Ranging(4.5, 8.0)))
    assert list(found) == [pytest.approx(-WEST), -inf, inf, pytest.approx(NORTH)]


def test_noise_has_its_deviation_and_depends_on_key_and_step_alone():
    sensor = lidar(360, ranging=Ranging(0.1, 30.0, 0.02))
    exact = read(lidar(360))
    errors = np.array([read(sensor, k=k) - exact for k in range(0, 1000, 50)])
    assert errors.std() == pytest.approx(0.02, rel=0.05)
    assert abs(errors.mean()) < 0.001
    assert abs(np.corrcoef(errors[:, :-1].reshape(-1), errors[:, 1:].reshape(-1))[0, 1]) < 0.05
    again = sensor.sampler(np.uint64(0), ROOM)
    later = [again(state((0.0, 0.0, 1.5)), k) for k in (100, 50)]
    np.testing.assert_array_equal(later[1], read(sensor, k=50))
    assert (read(sensor, k=50, noise=1) != read(sensor, k=50)).mean() > 0.99


def test_a_share_of_the_returns_is_lost():
    found = np.array([read(lidar(360, ranging=Ranging(0.1, 30.0, lost=0.1)), k=k) for k in range(20)])
    assert (found == inf).mean() == pytest.approx(0.1, abs=0.01)
    assert len({tuple(row == inf) for row in found}) == 20
    assert (read(lidar(8, ranging=Ranging(0.1, 30.0, lost=1.0))) == inf).all()


def test_a_world_samples_it_on_its_grid():
    now = 0
    body = Multirotor(at=(0.0, 0.0, 0.0), heading_deg=90.0, added_sensors=(lidar(4, at=(0.0, 0.0, 1.0)),))
    world = World(lambda: now, [body], frame=LocalFrame(47.4, 8.5, 488.0), scene=ROOM)
    first = world.measurement(0, "lidar")
    assert first.values == pytest.approx([-WEST, -SOUTH, EAST, NORTH])
    now = 199 * MS
    assert world.measurement(0, "lidar").time == 100 * MS
    assert first.values == pytest.approx([-WEST, -SOUTH, EAST, NORTH])  # a sample is not overwritten


def test_wrong_limits_are_refused():
    with pytest.raises(UsageError, match="give the shorter one first"):
        Ranging(2.0, 1.0)
    with pytest.raises(UsageError, match="a share from 0 to 1"):
        Ranging(0.0, 1.0, lost=2.0)
