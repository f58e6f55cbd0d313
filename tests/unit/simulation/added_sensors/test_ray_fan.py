"""A fan of rays ends where single rays end: among polygons of any shape, from beside, above and below."""

import numpy as np
import pytest

from rigs.walled_room import box, lidar, state
from volery.base.frames import body_to_world, euler_to_quaternion
from volery.simulation.added_sensors.beams import Ranging
from volery.simulation.world.environment_models import Terrain
from volery.simulation.world.scene import Scene, Solid

REACH = 40.0


def star(random, east, north):
    """A simple polygon of some corners about a point, not convex as a rule, in either order."""
    count = random.integers(5, 9)
    angles = 2.0 * np.pi / count * (np.arange(count) + random.uniform(0.0, 1.0, count))
    radii = random.uniform(0.5, 4.0, count)
    corners = np.stack((east + radii * np.cos(angles), north + radii * np.sin(angles)), axis=1)
    return tuple(map(tuple, corners[:: random.choice([-1, 1])].tolist()))


def city(random):
    solids = []
    for index in range(120):
        floor = float(random.choice([-1.0, -1.0, 2.0, 6.0]))
        east, north = random.uniform(-40.0, 40.0, 2)
        corners = star(random, east, north)
        solids.append(Solid(f"solid {index}", corners, floor, floor + float(random.uniform(2.0, 9.0))))
    return Scene(solids)


@pytest.mark.parametrize("up", [0.5, 4.0, 12.0])
@pytest.mark.parametrize("seed", range(4))
def test_as_far_as_single_rays(seed, up):
    random = np.random.default_rng(seed)
    scene = city(random)
    for _ in range(3):
        east, north = random.uniform(-30.0, 30.0, 2)
        roll, pitch, yaw = random.uniform(-1.2, 1.2, 3)
        sensor = lidar(500, ranging=Ranging(0.0, REACH))
        found = sensor.sampler(np.uint64(0), scene)(
            state((east, north, up), roll, pitch, yaw, scene=scene), 0
        )
        turn = euler_to_quaternion(roll, pitch, yaw)
        ways = np.array([body_to_world(turn, tuple(beam)) for beam in sensor.beams()])
        single = scene.cast(np.tile((east, north, up), (500, 1)), ways, REACH)
        with np.errstate(divide="ignore"):
            ground = np.where(ways[:, 2] < 0.0, -up / ways[:, 2], np.inf)
        expected = np.minimum(single, np.where(ground <= REACH, ground, np.inf))
        np.testing.assert_array_equal(np.isfinite(found), np.isfinite(expected))
        met = np.isfinite(expected)
        assert met.any()
        assert np.allclose(found[met], expected[met], rtol=2e-3)  # the ground follows the globe


def test_no_ray_slips_through_between_two_sides():
    wall = Scene([box("one", 3.0, -3.0, 4.0, 0.0), box("other", 3.0, 0.0, 4.0, 3.0)])
    found = lidar(4).sampler(np.uint64(0), wall)(state((0.0, 0.0, 1.0), scene=wall), 0)
    assert found[2] == pytest.approx(3.0)  # straight at where they touch


def test_a_sensor_in_a_wall_reads_nothing_but_nearness():
    scene = Scene([box("wall", -1.0, -1.0, 1.0, 1.0)])
    assert set(lidar(16).sampler(np.uint64(0), scene)(state((0.0, 0.0, 1.0), scene=scene), 0)) == {-np.inf}


def test_the_ground_is_met_where_it_rises():
    slope = Terrain([[0.0, 10.0]], 0.0, 0.0, 100.0)  # 1 in 10 towards the east
    scene = Scene(terrain=slope)
    found = lidar(4).sampler(np.uint64(0), scene)(state((0.0, 0.0, 2.0), scene=scene), 0)
    assert found[2] == pytest.approx(20.0, abs=0.01)
    assert list(found[[0, 1, 3]]) == [np.inf] * 3
