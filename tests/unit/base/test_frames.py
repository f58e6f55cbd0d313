from __future__ import annotations

from math import cos, pi, radians, sin

import pymap3d
import pytest

from volery.base.frames import (
    LocalFrame,
    Quaternion,
    Vector,
    attitude_enu_to_ned,
    attitude_ned_to_enu,
    ecef_to_geodetic,
    enu_to_ned,
    euler_to_quaternion,
    flu_to_frd,
    geodetic_to_ecef,
    heading_to_yaw,
    multiply,
    ned_to_enu,
    quaternion_to_euler,
    turn_clockwise,
    wrap,
    yaw_to_heading,
)

PLACES = [
    (0.0, 0.0, 0.0),
    (37.0902, -3.5678, 640.0),
    (-35.363261, 149.165230, 584.0),
    (47.397742, 8.545594, 488.0),
    (-54.8, -68.3, 10.0),
    (89.9, 120.0, 0.0),
    (-90.0, 0.0, 2835.0),
    (12.0, 180.0, -400.0),
    (12.0, -179.9999, 8848.0),
]


def rotate(q: Quaternion, v: Vector) -> Vector:
    """*v* turned by *q*, by the definition."""
    w, x, y, z = q
    _, *turned = multiply(multiply(q, (0.0, *v)), (w, -x, -y, -z))
    return turned[0], turned[1], turned[2]


def test_axes_by_hand() -> None:
    assert enu_to_ned((1.0, 2.0, 3.0)) == (2.0, 1.0, -3.0)
    assert ned_to_enu((2.0, 1.0, -3.0)) == (1.0, 2.0, 3.0)
    assert flu_to_frd((1.0, 2.0, 3.0)) == (1.0, -2.0, -3.0)


@pytest.mark.parametrize(
    ("heading_deg", "yaw_deg"), [(0, 90), (90, 0), (180, -90), (270, 180), (45, 45), (-90, 180), (450, 0)]
)
def test_headings_by_hand(heading_deg: float, yaw_deg: float) -> None:
    assert heading_to_yaw(radians(heading_deg)) == pytest.approx(radians(yaw_deg), abs=1e-12)
    assert wrap(yaw_to_heading(radians(yaw_deg)) - radians(heading_deg)) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [
        (0.0, 0.0),
        (pi, pi),
        (-pi, pi),
        (3 * pi, pi),
        (-3 * pi, pi),
        (1.5 * pi, -0.5 * pi),
        (7.0, 7.0 - 2 * pi),
    ],
)
def test_an_angle_is_wrapped_to_one_turn(angle: float, wrapped: float) -> None:
    assert wrap(angle) == pytest.approx(wrapped)


def test_the_axes_of_a_body_that_flies_east_climbing() -> None:
    """Heading east, nose 30 degrees up: by hand in both frames."""
    ned = euler_to_quaternion(0.0, radians(30), radians(90))
    assert rotate(ned, (1.0, 0.0, 0.0)) == pytest.approx((0.0, cos(radians(30)), -sin(radians(30))))
    enu = attitude_ned_to_enu(ned)
    assert rotate(enu, (1.0, 0.0, 0.0)) == pytest.approx((cos(radians(30)), 0.0, sin(radians(30))))
    assert rotate(enu, (0.0, 1.0, 0.0)) == pytest.approx((0.0, 1.0, 0.0))  # its left is north
    assert attitude_enu_to_ned(enu) == pytest.approx(ned)


def test_euler_angles_turn_about_yaw_then_pitch_then_roll() -> None:
    yaw, pitch, roll = radians(30), radians(20), radians(10)
    about_z = (cos(yaw / 2), 0.0, 0.0, sin(yaw / 2))
    about_y = (cos(pitch / 2), 0.0, sin(pitch / 2), 0.0)
    about_x = (cos(roll / 2), sin(roll / 2), 0.0, 0.0)
    assert euler_to_quaternion(roll, pitch, yaw) == pytest.approx(
        multiply(multiply(about_z, about_y), about_x)
    )


@pytest.mark.parametrize("pitch", [pi / 2, -pi / 2])
def test_straight_up_and_straight_down_roll_is_zero(pitch: float) -> None:
    q = euler_to_quaternion(0.3, pitch, 0.5)
    roll, found, yaw = quaternion_to_euler(q)
    assert (roll, found) == (0.0, pitch)
    again = euler_to_quaternion(roll, found, yaw)
    assert abs(sum(a * b for a, b in zip(q, again, strict=True))) == pytest.approx(1.0)


@pytest.mark.parametrize("place", PLACES)
def test_earth_centred_coordinates_are_pymap3ds(place: Vector) -> None:
    expected = pymap3d.geodetic2ecef(*place)
    assert geodetic_to_ecef(*place) == pytest.approx(expected, abs=1e-8)
    latitude, longitude, height = ecef_to_geodetic(expected)
    assert latitude == pytest.approx(place[0], abs=1e-11)
    assert abs(wrap(radians(longitude - place[1]))) * cos(radians(latitude)) < 1e-13
    assert height == pytest.approx(place[2], abs=1e-8)


@pytest.mark.parametrize("origin", PLACES)
@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (100.0, -50.0, 30.0), (-20_000.0, 15_000.0, -500.0)])
def test_local_coordinates_are_pymap3ds(origin: Vector, offset: Vector) -> None:
    frame = LocalFrame(*origin)
    there = pymap3d.enu2geodetic(*offset, *origin)
    assert frame.to_enu(*there) == pytest.approx(offset, abs=1e-6)
    assert frame.to_enu(*there) == pytest.approx(pymap3d.geodetic2enu(*there, *origin), abs=1e-8)
    latitude, longitude, amsl = frame.from_enu(offset)
    assert latitude == pytest.approx(there[0], abs=1e-11)
    assert abs(wrap(radians(longitude - there[1]))) * cos(radians(latitude)) < 1e-12
    assert amsl == pytest.approx(there[2], abs=1e-6)


def test_ned_is_the_same_point() -> None:
    frame = LocalFrame(37.0, -3.0, 640.0)
    latitude, longitude, amsl = frame.from_ned((100.0, 200.0, -30.0))
    assert (latitude, longitude, amsl) == frame.from_enu((200.0, 100.0, 30.0))
    assert frame.to_ned(latitude, longitude, amsl) == pytest.approx((100.0, 200.0, -30.0), abs=1e-8)


def test_a_frame_is_a_value() -> None:
    frame = LocalFrame(37.0, -3.0, 640.0)
    frame.to_enu(37.0, -3.0, 640.0)
    assert frame == LocalFrame(37.0, -3.0, 640.0)
    assert hash(frame) == hash(LocalFrame(37.0, -3.0, 640.0))


def test_a_frame_given_in_integers_is_that_of_floats() -> None:
    frame = LocalFrame(46, -104, 900)
    assert repr(frame) == "LocalFrame(latitude=46.0, longitude=-104.0, amsl=900.0)"
    assert frame == LocalFrame(46.0, -104.0, 900.0)


def test_ahead_and_right_turned_by_the_heading_are_north_and_east_and_back() -> None:
    assert turn_clockwise((2.0, 1.0), radians(90.0)) == pytest.approx((-1.0, 2.0))
    assert turn_clockwise(turn_clockwise((2.0, 1.0), 0.3), -0.3) == pytest.approx((2.0, 1.0))
