"""Markers and light of a model; what is wrong with one names its line."""

import pytest

from volery.base.errors import ModelError

ZONES = "no_fly_zones:"


def environment_with(workshop, written):
    workshop.change(ZONES, f"{written}\n{ZONES}", "city.yaml")
    return workshop.load().environment


def test_a_marker_has_its_place_size_and_number(workshop):
    environment = environment_with(
        workshop, "markers: {pad: {at: port_north, id: 7, size: 40 cm, yaw: 30 deg}}"
    )
    (marker,) = environment.markers
    assert (marker.name, marker.at.east_m, marker.at.north_m) == ("pad", 10.0, 100.0)
    assert (marker.size_m, marker.number, marker.family, marker.yaw_deg) == (0.4, 7, "36h11", 30.0)


def test_the_light_is_one_of_three(workshop):
    assert workshop.load().environment.light == "day"
    assert workshop.load(None, None, "environment.light=dusk").environment.light == "dusk"
    with pytest.raises(ModelError, match=r"did you mean 'dusk'\?"):
        workshop.load(None, None, "environment.light=dask")


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("markers: {pad: {at: port_north, id: 587, size: 40 cm}}", "36h11 has the numbers 0 to 586"),
        ("markers: {pad: {at: port_north, id: 30, size: 40 cm, family: 16h5}}", "numbers 0 to 29"),
        ("markers: {pad: {at: port_north, id: 7, size: 0 m}}", "more than 0 m"),
        ("markers: {pad: {at: port_nort, id: 7, size: 40 cm}}", "did you mean 'port_north'?"),
        ("markers: {pad: {at: port_north, id: 7, size: 40 cm, family: 36h12}}", "did you mean '36h11'?"),
        ("markers: {pad: {at: port_north, size: 40 cm}}", "id"),
    ],
)
def test_a_wrong_one_is_blamed_on_its_line(workshop, written, said):
    with pytest.raises(ModelError) as raised:
        environment_with(workshop, written)
    assert f"city.yaml:{workshop.line_of(written.partition(':')[0], 'city.yaml')}" in str(raised.value)
    assert said in str(raised.value)
