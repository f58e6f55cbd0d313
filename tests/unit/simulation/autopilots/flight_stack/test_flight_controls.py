"""Each control of the inner loops reaches and holds its quantities."""

import math
from math import radians

import pytest

from volery.base.errors import UsageError
from volery.base.time import MS
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.world.body_specs import BatteryPack
from volery.simulation.world.environment_models import Wind


def test_off_stops_the_motors_and_idle_turns_them(drone):
    flown = drone("perfect")
    flown.wait(1)
    assert flown.flight.estimate().motor_pwm == (1000, 1000, 1000, 1000)
    flown.drive(Control.IDLE)
    flown.wait(2)
    assert flown.flight.estimate().motor_pwm == (1100, 1100, 1100, 1100)
    assert flown.flight.estimate().landed
    flown.drive(Control.OFF)
    flown.wait(0.1)
    assert flown.flight.estimate().motors == (0.0, 0.0, 0.0, 0.0)


def test_position_control_holds_to_a_nanometre_without_noise(drone):
    ideal = BatteryPack(capacity_ah=1e12, resistance_ohm=1e-18)
    flown = drone("perfect", battery=ideal).hover()
    flown.wait(240)
    before = flown.flight.truth().position
    flown.wait(60)
    assert math.dist(before, flown.flight.truth().position) < 1e-9


def test_velocity_is_reached_and_then_held(drone):
    flown = drone("perfect").hover()
    flown.drive(Control.VELOCITY, velocity=(2.0, -1.0, -0.5))
    flown.wait(8)
    for _, estimate, _ in flown.wait(2):
        assert estimate.velocity == pytest.approx((2.0, -1.0, -0.5), abs=0.05)


def test_velocity_is_limited_in_the_plane_and_in_height(drone):
    flown = drone("perfect").hover(20.0)
    flown.drive(Control.VELOCITY, velocity=(30.0, 0.0, 9.0), speed=4.0, speed_down=1.0)
    flown.wait(8)
    velocity = flown.flight.estimate().velocity
    assert velocity[0] == pytest.approx(4.0, abs=0.1)
    assert velocity[2] == pytest.approx(1.0, abs=0.1)


def test_a_zero_velocity_brakes_and_stays(drone):
    flown = drone("perfect").hover()
    flown.drive(Control.VELOCITY, velocity=(8.0, 0.0, 0.0))
    flown.wait(8)
    flown.drive(Control.VELOCITY, velocity=(0.0, 0.0, 0.0))
    flown.wait(12)
    first = flown.flight.estimate().position
    flown.wait(5)
    assert math.dist(first, flown.flight.estimate().position) < 0.1


def test_height_is_kept_while_flying_at_a_velocity(drone):
    flown = drone("perfect").hover()
    flown.drive(Control.VELOCITY_HEIGHT, position=(0.0, 0.0, -12.0), velocity=(3.0, 0.0, 0.0))
    flown.wait(12)
    estimate = flown.flight.estimate()
    assert estimate.position[2] == pytest.approx(-12.0, abs=0.1)
    assert estimate.velocity[0] == pytest.approx(3.0, abs=0.1)


def test_climb_control_holds_a_rate_and_the_commanded_tilt(drone):
    flown = drone("perfect").hover()
    flown.drive(Control.CLIMB, climb=1.0, roll=radians(5.0))
    flown.wait(4)
    estimate = flown.flight.estimate()
    assert -estimate.velocity[2] == pytest.approx(1.0, abs=0.1)
    assert math.degrees(estimate.attitude[0]) == pytest.approx(5.0, abs=0.5)
    assert estimate.velocity[1] > 0.5  # to the right, east


def test_attitude_flies_angles_and_throttle(drone):
    flown = drone("perfect").hover(30.0)
    hover = flown.flight.estimate().throttle
    flown.drive(Control.ATTITUDE, pitch=radians(-10.0), throttle=hover)
    flown.wait(2)
    estimate = flown.flight.estimate()
    assert math.degrees(estimate.attitude[1]) == pytest.approx(-10.0, abs=1.0)
    assert estimate.velocity[0] > 1.0
    flown.drive(Control.ATTITUDE, throttle=0.0)
    flown.wait(1)
    assert flown.flight.estimate().velocity[2] > 4.0  # it falls


@pytest.mark.parametrize(("turn", "expected"), [({"yaw": 1.5}, 1.5), ({"yaw": -2.5}, -2.5)])
def test_yaw_turns_to_an_angle_by_the_shorter_way(drone, turn, expected):
    flown = drone("perfect").hover()
    flown.drive(Control.POSITION, position=(0.0, 0.0, -10.0), **turn)
    flown.wait(8)
    assert flown.flight.estimate().attitude[2] == pytest.approx(expected, abs=0.02)
    assert math.dist(flown.flight.estimate().position, (0.0, 0.0, -10.0)) < 0.2


def test_yaw_turns_at_a_rate(drone):
    flown = drone("perfect").hover()
    flown.drive(Control.POSITION, position=(0.0, 0.0, -10.0), yaw_rate=0.5)
    flown.wait(4)
    assert flown.flight.estimate().rates[2] == pytest.approx(0.5, abs=0.02)


def test_a_change_of_control_does_not_jerk(drone):
    flown = drone("perfect").hover()
    flown.drive(Control.POSITION, position=(100.0, 0.0, -10.0))
    flown.wait(6)
    fast = flown.flight.estimate()
    flown.drive(Control.CLIMB, pitch=fast.attitude[1])
    flown.wait(0.2)
    assert abs(flown.flight.estimate().velocity[2]) < 0.1
    flown.drive(Control.VELOCITY, velocity=fast.velocity)
    tilts = [estimate.attitude[1] for _, estimate, _ in flown.wait(2)]
    assert max(abs(tilt - fast.attitude[1]) for tilt in tilts) < radians(12.0)


def test_position_is_held_in_gusty_wind(drone):
    flown = drone("rtk", wind=Wind(east=6.0, north=3.0, gust=1.0)).hover()
    flown.wait(10)
    errors = [math.dist(estimate.position, (0.0, 0.0, -10.0)) for _, estimate, _ in flown.wait(30)]
    assert max(errors) < 1.0


def test_the_landed_detector_reports_the_ground_and_not_the_air(drone):
    flown = drone("consumer").hover(20.0)
    flown.drive(Control.VELOCITY, velocity=(3.0, 0.0, 1.5))
    seen = flown.wait(8)
    flown.drive(Control.POSITION, position=(0.0, 0.0, -15.0))
    seen += flown.wait(10)
    assert not any(estimate.landed for _, estimate, _ in seen)
    flown.drive(Control.POSITION_CLIMB, climb=-0.5)
    seen = flown.wait(60, until=lambda estimate, truth: estimate.landed)
    assert seen[-1][2].on_ground
    touched = next(after for after, _, truth in seen if truth.on_ground)
    assert 1.0 <= seen[-1][0] - touched < 5.0


def test_a_landed_vehicle_takes_off_again(drone):
    flown = drone("consumer").hover(5.0)
    flown.drive(Control.POSITION_CLIMB, climb=-0.5)
    flown.wait(30, until=lambda estimate, truth: estimate.landed)
    flown.drive(Control.POSITION, position=(0.0, 0.0, -5.0))
    flown.wait(15)
    assert flown.flight.estimate().position[2] == pytest.approx(-5.0, abs=0.3)
    assert not flown.flight.estimate().landed


def test_the_tilt_limit_holds(drone):
    flown = drone("perfect").hover()
    flown.drive(Control.POSITION, position=(200.0, 0.0, -10.0), accel=9.0, speed=20.0, tilt=radians(15.0))
    tilts = [abs(estimate.attitude[1]) for _, estimate, _ in flown.wait(6)]
    assert radians(12.0) < max(tilts) < radians(18.0)


def test_a_rover_steers_as_commanded_and_stops(rover):
    flown = rover("perfect").ready(2)
    flown.drive(Control.STEER, throttle=0.1, steering=0.5)
    flown.wait(5)
    estimate = flown.flight.estimate()
    assert estimate.rates[2] > 0.2  # clockwise: to the right
    assert estimate.motor_pwm == (1750, 0, 1550, 0)
    flown.drive(Control.DRIVE)
    flown.wait(10)
    assert math.hypot(*flown.flight.truth().velocity) < 0.01


def test_a_rover_drives_a_heading_and_backwards(rover):
    flown = rover("perfect").ready(2)
    flown.drive(Control.DRIVE, velocity=(2.0, 0.0, 0.0), yaw=1.0, accel=1.0)
    flown.wait(10)
    assert flown.flight.estimate().attitude[2] == pytest.approx(1.0, abs=0.03)
    flown.drive(Control.DRIVE, velocity=(-1.0, 0.0, 0.0), yaw=1.0, accel=1.0)
    flown.wait(10)
    estimate = flown.flight.estimate()
    assert estimate.velocity[0] == pytest.approx(-math.cos(estimate.attitude[2]), abs=0.1)


def test_invalid_set_points_are_refused(drone):
    flight = drone("perfect").flight
    with pytest.raises(UsageError, match="finite"):
        flight.drive(Setpoint(Control.POSITION, position=(math.nan, 0.0, 0.0)))
    with pytest.raises(UsageError, match="motor 7"):
        flight.weaken_motor(7, 0.5)


def test_a_set_point_that_is_in_force_costs_no_stop_of_the_physics(drone):
    flown = drone("perfect").ready()
    advances = []
    for down in (-5.0, -5.0, -6.0):
        flown.drive(Control.POSITION, position=(0.0, 0.0, down))
        before = flown.world.advances
        flown.wait(0.05)
        advances.append(flown.world.advances - before)
    assert advances[0] == advances[2] == advances[1] + 1


def test_an_estimate_keeps_its_values_while_the_vehicle_moves_on(drone):
    flown = drone("perfect").ready()
    flown.drive(Control.POSITION, position=(0.0, 0.0, -5.0))
    _, first, _ = flown.wait(2)[-1]
    kept = first.position, first.gps.velocity, first.battery_amps
    _, last, _ = flown.wait(1)[-1]
    assert last.position[2] < first.position[2]
    assert (first.position, first.gps.velocity, first.battery_amps) == kept


def test_an_estimate_is_the_same_object_until_the_next_grid_step(drone):
    flown = drone("perfect")
    first = flown.flight.estimate()
    flown.now += 1 * MS
    assert flown.flight.estimate() is first
    flown.now += 1 * MS
    assert flown.flight.estimate() is not first
    assert first.time == 0
