"""Routes: the shortest way on roads and through the air, around what must not be flown through."""

from __future__ import annotations

from dataclasses import replace

import pytest

from volery.base.position import AMSL


@pytest.fixture
def route(make_bench, city):
    """``route(start, goal, vehicle, city)`` as names of places."""

    def ask(start, goal, vehicle, surroundings=city):
        bench = make_bench()
        instance = bench.start("route_generator.py", "RouteGenerator", active=False, city=surroundings)
        found = []

        def body():
            places = surroundings.places
            points = instance.object.get_route(places[start].position, places[goal].position, vehicle)
            by_degrees = {(place.latitude, place.longitude): name for name, place in places.items()}
            found.extend((by_degrees[point.latitude, point.longitude], point.altitude) for point in points)

        bench.kernel.call_at(1, lambda: bench.kernel.spawn(body, "asker", instance.context))
        bench.run(1)
        assert bench.failures == []
        return found

    return ask


def names(points):
    return [name for name, _ in points]


def test_roads_are_followed(route):
    assert names(route("store", "hospital_b", "rover")) == ["store", "port_a", "port_b", "hospital_b"]


def test_a_no_fly_zone_is_flown_around(route, city):
    assert names(route("port_a", "port_b", "drone")) == ["port_a", "aside", "port_b"]
    without = replace(city, no_fly_zones=())
    assert names(route("port_a", "port_b", "drone", without)) == ["port_a", "port_b"]


def test_a_zone_matters_at_its_height_only(route, city, make_square):
    below = replace(city, no_fly_zones=(make_square("school", 0.0, 200.0, 50.0, ceiling=20.0),))
    assert names(route("port_a", "port_b", "drone", below)) == ["port_a", "port_b"]


def test_altitudes_are_amsl_at_the_height_of_the_corridor(route):
    assert {altitude for _, altitude in route("port_a", "port_b", "drone")} == {AMSL(45.0)}
    assert {altitude for _, altitude in route("store", "port_a", "rover")} == {AMSL(20.0)}


def test_where_no_corridor_is_left_there_is_no_route(route, city, make_square):
    closed = replace(city, no_fly_zones=(make_square("parade", 0.0, 390.0, 300.0),))
    assert route("port_a", "port_b", "drone", closed) == []
