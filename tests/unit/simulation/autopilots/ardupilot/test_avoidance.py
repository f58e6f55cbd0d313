"""Avoidance: velocities before the fence and before obstacles, and backing away from them."""

from __future__ import annotations

from math import hypot, inf, radians
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as some

from volery.simulation.autopilots.ardupilot.avoidance import (
    StoppingLaw,
    _to_crossing,
    _within_circle,
    _within_edges,
    avoidance_of,
)
from volery.simulation.autopilots.ardupilot.fence import fence_of
from volery.simulation.autopilots.ardupilot.fence_shapes import FenceCircle, FencePolygon

SLIDE, STOP, ROVER = StoppingLaw(1.0, 1.0, False), StoppingLaw(1.0, 1.0, True), StoppingLaw(0.0, 0.5, True)
LAWS = (SLIDE, STOP, ROVER, StoppingLaw(0.0, 0.5, False))
SQUARE = FencePolygon(((-20.0, -20.0), (-20.0, 20.0), (20.0, 20.0), (20.0, -20.0)), inside=True)
MARGIN = 2.0
ARM, SET_MODE, TAKEOFF, LOITER, GUIDED, ALT_HOLD, ACRO = 400, 176, 22, 5, 4, 2, 1
AUXILIARY = 218

velocities = some.tuples(some.floats(-12.0, 12.0), some.floats(-12.0, 12.0))
places = some.tuples(some.floats(-17.9, 17.9), some.floats(-17.9, 17.9))


def flown(
    law: StoppingLaw, place: tuple[float, float], velocity: tuple[float, float], limited: Any
) -> list[Any]:
    """Return the places of 30 s of flight with a velocity as limited, ten times a second."""
    passed = [place]
    for _ in range(300):
        north, east = limited(velocity, passed[-1], law)
        passed.append((passed[-1][0] + 0.1 * north, passed[-1][1] + 0.1 * east))
    return passed


@given(places, velocities, some.sampled_from(LAWS))
def test_no_velocity_leaves_a_polygon(
    place: tuple[float, float], velocity: tuple[float, float], law: StoppingLaw
) -> None:
    def limited(wanted: Any, here: Any, law: StoppingLaw) -> Any:
        return _within_edges(wanted, here, SQUARE.edges(), MARGIN, law)

    most = 20.0 if law.stops else 18.3  # a shortened velocity keeps the margin along its path
    for north, east in flown(law, place, velocity, limited):
        assert max(abs(north), abs(east)) <= most


@given(places, velocities, some.sampled_from(LAWS), some.booleans())
def test_no_velocity_crosses_a_circle(
    place: tuple[float, float], velocity: tuple[float, float], law: StoppingLaw, inside: bool
) -> None:
    circle = FenceCircle((1.0, -2.0), 14.0 if inside else 6.0, inside)
    away = hypot(place[0] - 1.0, place[1] + 2.0)
    assume(away <= 12.0 if inside else away >= 8.0 and not law.stops)

    def limited(wanted: Any, here: Any, law: StoppingLaw) -> Any:
        return _within_circle(wanted, here, circle, MARGIN, law)

    for north, east in flown(law, place, velocity, limited):
        away = hypot(north - 1.0, east + 2.0)
        assert away <= 12.0 + 0.4 if inside else away >= 8.0 - 0.4


def test_a_sliding_velocity_keeps_its_part_along_the_edge() -> None:
    north, east = _within_edges((5.0, 3.0), (18.0, 0.0), SQUARE.edges(), MARGIN, SLIDE)
    assert (north, east) == (pytest.approx(0.0, abs=1e-9), 3.0)


def test_a_shortened_velocity_keeps_its_direction() -> None:
    north, east = _within_edges((5.0, 3.0), (15.0, 0.0), SQUARE.edges(), MARGIN, STOP)
    assert east / north == pytest.approx(0.6)
    assert hypot(north, east) < hypot(5.0, 3.0)
    assert _within_edges((5.0, 3.0), (18.5, 0.0), SQUARE.edges(), MARGIN, STOP) == (0.0, 0.0)


@given(velocities, some.sampled_from(LAWS))
def test_a_velocity_far_from_all_limits_is_unchanged(velocity: tuple[float, float], law: StoppingLaw) -> None:
    wide = [((x * 50.0, y * 50.0), (z * 50.0, w * 50.0)) for (x, y), (z, w) in SQUARE.edges()]
    assert _within_edges(velocity, (0.0, 0.0), wide, MARGIN, law) == velocity
    assert _within_circle(velocity, (0.0, 0.0), FenceCircle((0.0, 0.0), 900.0, True), MARGIN, law) == velocity


def test_the_distance_of_a_crossing() -> None:
    assert _to_crossing((0.0, 0.0), (1.0, 0.0), (5.0, -1.0), (5.0, 1.0)) == 5.0
    assert _to_crossing((0.0, 0.0), (-1.0, 0.0), (5.0, -1.0), (5.0, 1.0)) == inf
    assert _to_crossing((0.0, 0.0), (1.0, 0.0), (5.0, 1.0), (5.0, 2.0)) == inf
    assert _to_crossing((0.0, 0.0), (1.0, 0.0), (5.0, 0.0), (6.0, 0.0)) == inf


@given(some.floats(0.1, 20.0), some.sampled_from(LAWS))
def test_the_stopping_distance_is_that_of_the_law(speed: float, law: StoppingLaw) -> None:
    assert law.speed(law.stopping_distance(speed)) == pytest.approx(speed)


# -- a vehicle


@pytest.fixture
def flying(station: Any) -> Any:
    """Makes a copter with a proximity sensor that flies at 10 m to the north of home."""

    def made(mode: int, **parameters: float) -> Any:
        rig = station(parameters={"PRX1_TYPE": 2, "ARMING_CHECK": 0, **parameters})
        rig.beat()
        rig.run(0.5)
        assert rig.command(SET_MODE, 1, GUIDED) == 0
        assert rig.command(ARM, 1) == 0
        assert rig.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 10.0) == 0
        rig.run(15.0)
        steer(rig)
        assert rig.command(SET_MODE, 1, mode) == 0
        return rig

    return made


def steer(rig: Any, pitch: int = 1500, throttle: int = 1500) -> None:
    """Set pitch and throttle stick; the others stay in the middle."""
    pulses = {f"chan{channel}_raw": 1500 for channel in range(1, 9)}
    pulses |= {"chan2_raw": pitch, "chan3_raw": throttle}
    rig.send("RC_CHANNELS_OVERRIDE", target_system=1, target_component=1, **pulses)


def fly(rig: Any, seconds: float, pitch: int, wall: float = inf, ahead: float = inf) -> None:
    """Fly with the pitch stick beside an obstacle.

    Args:
        rig: The copter, which points to the north.
        seconds: How long.
        pitch: Pulse width of the pitch stick [us].
        wall: Distance of a wall to the north of the estimator's origin [m].
        ahead: Distance of an obstacle that stays ahead of the copter [m].
    """
    for _ in range(round(10 * seconds)):
        steer(rig, pitch)
        far = min(ahead, wall - rig.vehicle.estimate.position[0])
        if far < inf:
            cm = max(10, round(100 * far))
            limits = {"min_distance": 10, "max_distance": 3000, "type": 0, "id": 1, "covariance": 255}
            at = {"time_boot_ms": round(rig.now * 1000), "orientation": 0}
            rig.send("DISTANCE_SENSOR", current_distance=cm, **at, **limits)
        rig.run(0.1)


@pytest.mark.parametrize("behaviour", [0, 1], ids=["slides", "stops"])
def test_a_copter_stands_before_a_wall(behaviour: int, flying: Any) -> None:
    rig = flying(LOITER, AVOID_BEHAVE=behaviour)
    passed = []
    for _ in range(80):
        fly(rig, 0.5, 1400, wall=25.0)
        passed.append(rig.vehicle.estimate.position[0])
    assert max(passed) < 25.0  # it swings about the margin, as PRX_FILT delays the distances
    assert sum(passed[-20:]) / 20.0 == pytest.approx(22.9, abs=0.3)


@pytest.mark.parametrize(
    "parameters",
    [{"AVOID_ENABLE": 0}, {"AVOID_ENABLE": 1}, {"RC7_OPTION": 40}],
    ids=["off", "fence", "switch"],
)
def test_without_avoidance_it_flies_on(parameters: dict[str, float], flying: Any) -> None:
    rig = flying(LOITER, **parameters)
    if "RC7_OPTION" in parameters:
        avoidance_of(rig.vehicle).by_proximity = False
    fly(rig, 25.0, 1400, wall=25.0)
    assert rig.vehicle.estimate.position[0] > 28.0


def test_it_backs_away_from_what_comes_near(flying: Any) -> None:
    rig = flying(LOITER)
    fly(rig, 5.0, 1500, ahead=0.5)
    assert -0.9 < rig.vehicle.estimate.velocity[0] < -0.4
    fly(rig, 6.0, 1500, ahead=9.0)
    assert abs(rig.vehicle.estimate.velocity[0]) < 0.2  # it holds where it is then
    assert rig.vehicle.estimate.position[0] < -1.5


def test_it_does_not_back_away_without_a_speed_for_it(flying: Any) -> None:
    rig = flying(LOITER, AVOID_BACKUP_SPD=0)
    fly(rig, 5.0, 1500, ahead=0.5)
    assert abs(rig.vehicle.estimate.position[0]) < 0.5


def test_below_a_height_obstacles_do_not_count(flying: Any) -> None:
    rig = flying(LOITER, RNGFND1_TYPE=1, AVOID_ALT_MIN=12)
    fly(rig, 5.0, 1500, ahead=0.5)
    assert abs(rig.vehicle.estimate.position[0]) < 0.5
    rig = flying(LOITER, RNGFND1_TYPE=1, AVOID_ALT_MIN=8)
    fly(rig, 5.0, 1500, ahead=0.5)
    assert rig.vehicle.estimate.position[0] < -1.0


def test_altitude_hold_leans_away(flying: Any) -> None:
    rig = flying(ALT_HOLD)
    fly(rig, 1.5, 1500, ahead=2.0)
    assert rig.vehicle.setpoint.pitch == pytest.approx(radians(10.0))
    assert rig.vehicle.estimate.velocity[0] < -0.3
    fly(rig, 4.0, 1500, ahead=4.5)
    assert rig.vehicle.setpoint.pitch == pytest.approx(radians(4.5), abs=radians(0.5))


def test_a_climb_ends_below_the_ceiling_and_below_what_is_above(flying: Any) -> None:
    rig = flying(ALT_HOLD, FENCE_ENABLE=1, FENCE_TYPE=1, FENCE_ALT_MAX=16)
    for _ in range(150):
        steer(rig, throttle=1900)
        rig.run(0.1)
    assert rig.height == pytest.approx(14.0, abs=0.5)
    rig = flying(ALT_HOLD)
    for _ in range(150):
        steer(rig, throttle=1900)
        cm = max(10, round(100 * (20.0 - rig.height)))
        limits = {"min_distance": 10, "max_distance": 3000, "type": 0, "id": 1, "covariance": 255}
        rig.send("DISTANCE_SENSOR", current_distance=cm, time_boot_ms=0, orientation=24, **limits)
        rig.run(0.1)
    assert rig.height == pytest.approx(18.0, abs=0.5)


@pytest.mark.parametrize("backwards", [False, True])
def test_a_rover_stands_before_the_fence(backwards: bool, station: Any) -> None:
    rig = station("rover", parameters={"FENCE_ENABLE": 1, "FENCE_TYPE": 2, "FENCE_RADIUS": 30})
    rig.beat()
    rig.run(0.5)
    assert rig.command(SET_MODE, 1, ACRO) == 0
    assert rig.command(ARM, 1) == 0
    for _ in range(400):
        steer(rig, throttle=1420 if backwards else 1580)
        rig.run(0.1)
    reached = rig.vehicle.estimate.position[0]
    assert (-reached if backwards else reached) == pytest.approx(27.5, abs=0.7)
    assert abs(rig.vehicle.estimate.velocity[0]) < 0.3
    assert rig.vehicle.mode.name == "ACRO"


def test_a_rover_on_its_way_to_a_point_stands_before_an_exclusion(station: Any) -> None:
    rig = station("rover", parameters={"FENCE_ENABLE": 1, "FENCE_TYPE": 4})
    rig.beat()
    rig.run(0.5)
    latitude, longitude, _ = rig.home.from_ned((25.0, 0.0, 0.0))
    circle = {"command": 5004, "param1": 5.0, "frame": 3, "current": 0, "autocontinue": 1, "seq": 0}
    blank = dict.fromkeys(("param2", "param3", "param4", "z"), 0.0)
    target = {"target_system": 1, "target_component": 1, "mission_type": 1}
    rig.send("MISSION_COUNT", **target, count=1)
    rig.run(0.1)
    place = {"x": round(latitude * 1e7), "y": round(longitude * 1e7)}
    rig.send("MISSION_ITEM_INT", **target, **circle, **blank, **place)
    rig.run(0.1)
    assert rig.command(SET_MODE, 1, 15) == 0
    assert rig.command(ARM, 1) == 0
    goal = {"x": 50.0, "coordinate_frame": 1, "type_mask": 3576, "target_system": 1, "target_component": 1}
    rig.send("SET_POSITION_TARGET_LOCAL_NED", **goal)
    rig.run(40.0)
    north, east, _ = rig.vehicle.estimate.position
    assert north == pytest.approx(18.0, abs=0.7)
    assert abs(east) < 1.0
    assert not fence_of(rig.vehicle).breached
