"""Properties of conversions between frames."""

from __future__ import annotations

from math import cos, isclose, pi, radians

import pymap3d
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.base.frames import (
    LocalFrame,
    Quaternion,
    Vector,
    attitude_ned_to_enu,
    enu_to_ned,
    euler_to_quaternion,
    flu_to_frd,
    heading_to_yaw,
    multiply,
    quaternion_to_euler,
    world_to_body,
    wrap,
)

ANGLES = st.floats(-10.0, 10.0)
TILTS = st.floats(-1.57, 1.57)  # short of straight up and down
METRES = st.floats(-20_000.0, 20_000.0)
OFFSETS = st.tuples(METRES, METRES, st.floats(-500.0, 10_000.0))
ORIGINS = st.builds(LocalFrame, st.floats(-89.0, 89.0), st.floats(-180.0, 180.0), st.floats(-400.0, 8000.0))


def rotate(q: Quaternion, v: Vector) -> Vector:
    w, x, y, z = q
    _, *turned = multiply(multiply(q, (0.0, *v)), (w, -x, -y, -z))
    return turned[0], turned[1], turned[2]


@given(ORIGINS, OFFSETS)
def test_there_and_back_is_the_same_place(frame: LocalFrame, offset: Vector) -> None:
    assert frame.to_enu(*frame.from_enu(offset)) == pytest.approx(offset, abs=1e-7)


@given(ORIGINS, OFFSETS)
def test_places_are_where_pymap3d_has_them(frame: LocalFrame, offset: Vector) -> None:
    latitude, longitude, height = frame.from_enu(offset)
    expected = pymap3d.enu2geodetic(*offset, frame.latitude, frame.longitude, frame.amsl)
    assert isclose(latitude, expected[0], abs_tol=1e-10)
    assert abs(wrap(radians(longitude - expected[1]))) * cos(radians(latitude)) < 1e-11
    assert isclose(height, expected[2], abs_tol=1e-6)


@given(ANGLES)
def test_heading_and_yaw_are_each_others_inverse(angle: float) -> None:
    assert isclose(wrap(heading_to_yaw(heading_to_yaw(angle)) - angle), 0.0, abs_tol=1e-12)


@given(st.floats(-1e6, 1e6))
def test_a_wrapped_angle_is_within_one_turn_and_points_the_same_way(angle: float) -> None:
    wrapped = wrap(angle)
    assert -pi < wrapped <= pi
    assert isclose(cos(wrapped), cos(angle), abs_tol=1e-9)


@given(st.floats(-3.14, 3.14), TILTS, st.floats(-3.14, 3.14))
def test_euler_angles_survive_a_quaternion(roll: float, pitch: float, yaw: float) -> None:
    back = quaternion_to_euler(euler_to_quaternion(roll, pitch, yaw))
    assert back == pytest.approx((roll, pitch, yaw), abs=1e-7)


@given(ANGLES, st.floats(-pi / 2, pi / 2), ANGLES)
def test_any_attitude_survives_euler_angles(roll: float, pitch: float, yaw: float) -> None:
    q = euler_to_quaternion(roll, pitch, yaw)
    again = euler_to_quaternion(*quaternion_to_euler(q))
    assert abs(sum(a * b for a, b in zip(q, again, strict=True))) > 1.0 - 1e-10


@given(ANGLES, TILTS, ANGLES, OFFSETS)
def test_an_attitude_turns_the_same_body_in_both_frames(
    roll: float, pitch: float, yaw: float, v: Vector
) -> None:
    ned = euler_to_quaternion(roll, pitch, yaw)
    in_enu = rotate(attitude_ned_to_enu(ned), v)
    assert enu_to_ned(in_enu) == pytest.approx(rotate(ned, flu_to_frd(v)), abs=1e-7)


@given(st.floats(-3.0, 3.0), st.floats(-1.5, 1.5), st.floats(-3.0, 3.0))
def test_the_heading_of_an_attitude_is_the_yaw_of_it_in_the_other_frame(
    roll: float, pitch: float, heading: float
) -> None:
    enu = attitude_ned_to_enu(euler_to_quaternion(roll, pitch, heading))
    found = quaternion_to_euler(enu)
    assert found[0] == pytest.approx(roll, abs=1e-7)
    assert found[1] == pytest.approx(-pitch, abs=1e-7)  # nose up is positive in NED, negative in ENU
    assert wrap(found[2] - heading_to_yaw(heading)) == pytest.approx(0.0, abs=1e-7)


@given(ANGLES, ANGLES, ANGLES, OFFSETS)
def test_what_the_body_sees_of_its_own_axes_is_the_world_turned_back(
    roll: float, pitch: float, yaw: float, v: Vector
) -> None:
    attitude = euler_to_quaternion(roll, pitch, yaw)
    assert world_to_body(attitude, rotate(attitude, v)) == pytest.approx(v, abs=1e-9 * 30_000)
