"""What stands in the world is met by rays and by bodies: against geometry by brute force, and flights."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest

from volery.base.errors import UsageError
from volery.base.frames import LocalFrame
from volery.base.time import S
from volery.simulation.world.body_specs import Multirotor, WheeledRover
from volery.simulation.world.scene import Cylinder, Scene, Solid, contact
from volery.simulation.world.state_layout import U_THROTTLE
from volery.simulation.world.world import World

FRAME = LocalFrame(48.0, 11.0, 500.0)


def box(name: str, west: float, south: float, east: float, north: float, **heights: float) -> Solid:
    return Solid(name, ((west, south), (east, south), (east, north), (west, north)), **heights)


TOWER = box("tower", 10.0, -5.0, 20.0, 5.0, ceiling=30.0)
BRIDGE = box("bridge", -2.0, 10.0, 2.0, 30.0, floor=6.0, ceiling=7.0)


class Flown:
    """A world of one body whose time is set by hand."""

    def __init__(self, body: Multirotor | WheeledRover, *solids: Solid) -> None:
        self.at = 0
        self.world = World(lambda: self.at, [body], frame=FRAME, scene=Scene(solids))

    def fly(self, seconds: float, *commands: float) -> None:
        self.world.set_input(0, U_THROTTLE, *commands)
        self.at += round(seconds * S)
        self.world.advance_to_now(0)


# -- rays


@pytest.mark.parametrize(
    ("origin", "direction", "expected"),
    [
        ((0, 0, 1), (1, 0, 0), 10.0),
        ((0, 0, 31), (1, 0, 0), inf),
        ((15, 0, 40), (0, 0, -1), 10.0),
        ((15, 0, 10), (0, 1, 0), 0.0),
        ((0, 20, 1), (0, 0, 1), 5.0),
        ((0, 20, 9), (0, 0, -1), 2.0),
        ((-50, 20, 6.5), (1, 0, 0), 48.0),
        ((-5, 20, 3), (1, 0, 0), inf),
        ((15, 100, 1), (0, -1, 0), 95.0),
        ((500, 0, 1), (-1, 0, 0), 480.0),
    ],
)
def test_a_ray_ends_at_the_first_solid(origin, direction, expected):
    scene = Scene([TOWER, BRIDGE])
    [length] = scene.cast(np.array([origin], dtype=float), np.array([direction], dtype=float), 1000.0)
    assert length == pytest.approx(expected)


def test_rays_among_many_solids_end_where_each_alone_says():
    random = np.random.default_rng(5)
    solids = []
    for index in range(60):
        x, y = random.uniform(-80, 80, 2)
        corners = [
            (x + r * np.cos(a), y + r * np.sin(a))
            for a, r in zip(np.sort(random.uniform(0, 6, 5)), random.uniform(1, 9, 5), strict=True)
        ]
        solids.append(Solid(str(index), tuple(corners), random.uniform(-1, 5), random.uniform(6, 30)))
    origins = random.uniform((-100, -100, 0), (100, 100, 35), (200, 3))
    directions = random.normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    together = Scene(solids).cast(origins, directions, 120.0)
    alone = np.min([Scene([one]).cast(origins, directions, 120.0) for one in solids], axis=0)
    assert np.array_equal(together, alone)
    assert 20 < np.isfinite(together).sum() < 180


def test_a_ray_is_as_long_as_sampling_along_it_says():
    random = np.random.default_rng(6)
    scene = Scene([TOWER, BRIDGE])
    origins = random.uniform((-10, -10, 0), (30, 40, 40), (40, 3))
    directions = random.normal(size=(40, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    steps = np.arange(0.0, 60.0, 0.01)
    for origin, direction, length in zip(
        origins, directions, scene.cast(origins, directions, 60.0), strict=True
    ):
        east, north, up = origin[:, None] + direction[:, None] * steps
        inside = ((east > 10) & (east < 20) & (abs(north) < 5) & (up < 30) & (up > 0)) | (
            (abs(east) < 2) & (north > 10) & (north < 30) & (up > 6) & (up < 7)
        )
        first = steps[inside.argmax()] if inside.any() else inf
        assert length == pytest.approx(first, abs=0.011)


def test_a_solid_of_thousands_of_corners_is_met_where_all_its_sides_say():
    """Bounding boxes of sides change no result: against every side, one by one."""
    random = np.random.default_rng(8)
    angles = np.linspace(0.0, 2.0 * np.pi, 3000, endpoint=False)
    radii = 40.0 + 10.0 * np.sin(7.0 * angles) + random.uniform(-0.02, 0.02, 3000)
    corners = np.column_stack((radii * np.cos(angles), radii * np.sin(angles)))
    scene = Scene([Solid("park", tuple(map(tuple, corners)), 0.0, 20.0)])
    starts, sides = corners, np.roll(corners, -1, axis=0) - corners
    for east, north in random.uniform(-60.0, 60.0, (60, 2)):
        offsets = np.array((east, north)) - starts
        along = np.clip((offsets * sides).sum(axis=1) / (sides * sides).sum(axis=1), 0.0, 1.0)
        distance = np.linalg.norm(offsets - along[:, None] * sides, axis=1).min()
        above = starts[:, 1] > north
        crossed = above != np.roll(above, -1)
        meets = starts[:, 0] + sides[:, 0] * (north - starts[:, 1]) / np.where(crossed, sides[:, 1], 1.0)
        inside = (crossed & (east < meets)).sum() % 2 == 1
        touched, depth, *_ = contact(scene.arrays, Cylinder(east, north, 1.0, 1.1, 1.2, 0.5))
        expected = 0.5 + distance if inside else 0.5 - distance
        assert (touched, depth) == (pytest.approx((0, expected)) if expected > 0.0 else (-1, 0.0))
        [ray] = scene.cast(np.array([[east, north, 5.0]]), np.array([[0.6, 0.8, 0.0]]), 200.0)
        across = 0.6 * sides[:, 1] - 0.8 * sides[:, 0]
        lengths = -(offsets[:, 0] * sides[:, 1] - offsets[:, 1] * sides[:, 0]) / across
        share = -(offsets[:, 0] * 0.8 - offsets[:, 1] * 0.6) / across
        there = lengths[(lengths >= 0.0) & (share >= 0.0) & (share <= 1.0)]
        assert ray == pytest.approx(0.0 if inside else min(there, default=inf))


# -- contact


def test_a_cylinder_is_held_off_sides_and_undersides():
    scene = Scene([TOWER, BRIDGE]).arrays
    assert contact(scene, Cylinder(9.7, 0.0, 1.0, 1.1, 1.2, 0.4)) == pytest.approx((0, 0.1, -1.0, 0.0, 0.0))
    assert contact(scene, Cylinder(10.1, 0.0, 1.0, 1.1, 1.2, 0.4)) == pytest.approx((0, 0.5, -1.0, 0.0, 0.0))
    assert contact(scene, Cylinder(0.0, 20.0, 5.8, 5.95, 6.05, 0.4)) == pytest.approx(
        (1, 0.05, 0.0, 0.0, -1.0)
    )
    assert contact(scene, Cylinder(15.0, 0.0, 29.9, 30.1, 30.2, 0.4))[0] == -1  # stands on the top
    assert contact(scene, Cylinder(9.5, 0.0, 1.0, 1.1, 1.2, 0.4))[0] == -1


def test_a_place_in_a_building_is_on_its_top_and_one_under_a_bridge_is_not():
    mast = box("mast", 14.0, -1.0, 16.0, 1.0, floor=30.0, ceiling=35.0)
    scene = Scene([mast, TOWER, BRIDGE])
    assert [scene.standing_height(*at) for at in ((12, 0), (15, 0), (0, 20), (90, 0))] == pytest.approx(
        [30, 35, 0, 0], abs=0.001
    )


def test_a_solid_without_area_or_height_is_refused():
    for wrong in (Solid("flat", ((0, 0), (1, 1), (2, 0)), 3.0, 3.0), Solid("line", ((0, 0), (1, 1)))):
        with pytest.raises(UsageError, match=wrong.name):
            Scene([wrong])


# -- bodies


def test_a_multirotor_that_climbs_under_a_bridge_hits_it_and_falls():
    flown = Flown(Multirotor(at=(0.0, 20.0, 0.0)), BRIDGE)
    flown.fly(3.0, 0.75, 0.75, 0.75, 0.75)
    hit = flown.world.last_collision(0)
    assert hit is not None
    assert hit.solid == "bridge"
    assert hit.position[2] == pytest.approx(6.0 - 0.12, abs=0.05)
    assert hit.speed > 1.0
    flown.fly(5.0, 0.75, 0.75, 0.75, 0.75)
    truth = flown.world.truth(0)
    assert truth.on_ground
    assert truth.position[2] < 0.5
    assert truth.rotors[0] == pytest.approx(0.0, abs=1.0)
    after = flown.world.last_collision(0)
    assert after is not None
    assert after.collisions == 1


def test_a_multirotor_stands_and_begins_on_a_roof():
    flown = Flown(Multirotor(at=(15.0, 0.0, 0.0)), TOWER)
    flown.fly(1.0, 0.0, 0.0, 0.0, 0.0)
    truth = flown.world.truth(0)
    assert truth.on_ground
    assert truth.ground == 30.0
    assert truth.position[2] == pytest.approx(30.115, abs=0.01)
    assert flown.world.last_collision(0) is None


def test_a_rover_that_drives_against_a_house_stops_and_can_turn_back():
    flown = Flown(WheeledRover(heading_deg=90.0), TOWER)
    flown.fly(6.0, 0.0, 0.3)
    hit = flown.world.last_collision(0)
    assert hit is not None
    assert (hit.solid, hit.collisions) == ("tower", 1)
    assert flown.world.truth(0).position[0] == pytest.approx(10.0 - 0.3, abs=0.02)
    flown.fly(2.0, 0.0, -0.3)
    assert flown.world.truth(0).position[0] < 9.0


def test_without_solids_nothing_changes():
    bare, beside = Flown(Multirotor()), Flown(Multirotor(), TOWER)
    for one in (bare, beside):
        one.fly(2.0, 0.6, 0.61, 0.6, 0.61)
    assert bare.world.truth(0) == beside.world.truth(0)
