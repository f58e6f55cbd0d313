"""Estimates against the true state."""

import math
from statistics import fmean, pstdev

import pytest

from volery.simulation.autopilots.flight_stack.flight import Control


def horizontal_error(estimate, truth, flight):
    """Return the horizontal distance [m] between estimated and true position."""
    north, east, _ = flight.frame.to_ned(*estimate.geodetic)
    return math.hypot(north - truth.position[1], east - truth.position[0])


def vertical_error(estimate, truth, flight):
    _, _, down = flight.frame.to_ned(*estimate.geodetic)
    return abs(-down - truth.position[2])


def around(flown):
    """Fly a square of 40 m and return the reads."""
    seen = []
    for north, east in ((40.0, 0.0), (40.0, 40.0), (0.0, 40.0), (0.0, 0.0)):
        flown.drive(
            Control.POSITION, position=(north, east, -15.0), yaw=math.atan2(east - 20.0, north - 20.0)
        )
        seen += flown.wait(13)
    return seen


@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("sensors", ["consumer", "rtk"])
def test_position_is_within_three_declared_sigma(drone, sensors, seed):
    flown = drone(sensors, seed).hover()
    sigma = flown.flight.sigma
    for _, estimate, truth in around(flown):
        assert horizontal_error(estimate, truth, flown.flight) < 3.0 * sigma.horizontal + 0.05
        assert vertical_error(estimate, truth, flown.flight) < 3.0 * sigma.vertical + 0.05


@pytest.mark.parametrize("seed", [1, 2])
def test_attitude_and_velocity_are_good_in_flight(drone, seed):
    flown = drone("consumer", seed).hover()
    for _, estimate, truth in around(flown):
        w, x, y, z = truth.attitude
        upright = 1.0 - 2.0 * (x * x + y * y)
        _ew, ex, ey, _ez = estimate.quaternion
        assert abs((1.0 - 2.0 * (ex * ex + ey * ey)) - upright) < 0.03
        heading = math.pi / 2 - math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        assert abs(math.remainder(heading - estimate.attitude[2], 2.0 * math.pi)) < math.radians(5.0)
        estimated = (estimate.velocity[1], estimate.velocity[0], -estimate.velocity[2])
        assert math.dist(estimated, truth.velocity) < 0.5


@pytest.mark.parametrize("heading", [0.0, 90.0, -135.0])
def test_the_estimator_aligns_to_any_heading_on_the_ground(drone, heading):
    flown = drone("consumer", heading_deg=heading)
    estimate = flown.wait(20)[-1][1]
    assert estimate.attitude_ok
    error = math.remainder(math.degrees(estimate.attitude[2]) - heading, 360.0)
    assert abs(error) < 3.0


def test_position_is_valid_only_once_the_origin_is_set(drone):
    flown = drone("consumer")
    before = flown.wait(3)[-1][1]
    assert not before.position_ok
    assert before.attitude_ok
    flown.flight.set_origin()
    after = flown.wait(1)[-1][1]
    assert after.position_ok
    assert math.dist(after.position, (0.0, 0.0, 0.0)) < 1.0
    assert after.origin[2] == pytest.approx(584.1, abs=6.0)
    assert flown.flight.to_ned(*after.origin) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert flown.flight.from_ned((0.0, 0.0, 0.0)) == pytest.approx(after.origin, abs=1e-9)
    flown.flight.forget_origin()
    assert not flown.wait(1)[-1][1].position_ok


def test_without_satellites_the_estimate_is_dead_reckoning_and_expires(drone):
    flown = drone("consumer").hover()
    flown.flight.block_gps()
    flown.wait(5)
    estimate = flown.flight.estimate()
    assert estimate.gps.fix_type == 0
    assert estimate.gps.satellites == 0
    assert estimate.gps_age == pytest.approx(5.0, abs=0.3)
    assert estimate.position_ok
    flown.wait(6)
    assert not flown.flight.estimate().position_ok
    flown.flight.block_gps(False)
    flown.wait(2)
    estimate = flown.flight.estimate()
    assert estimate.position_ok
    assert estimate.gps.fix_type == 3


def test_a_fix_is_close_to_the_true_position(drone):
    flown = drone("rtk").hover()
    estimate, truth = flown.flight.estimate(), flown.flight.truth()
    fix = estimate.gps
    north, east, down = flown.flight.frame.to_ned(fix.latitude, fix.longitude, fix.amsl)
    assert math.hypot(north - truth.position[1], east - truth.position[0]) < 0.2
    assert -down == pytest.approx(truth.position[2], abs=0.3)
    assert fix.fix_type == 6
    assert fix.h_acc < 0.05


def test_sensors_at_rest_measure_gravity_magnetic_field_and_pressure(drone):
    flown = drone("perfect", heading_deg=90.0)
    estimate = flown.wait(1)[-1][1]
    assert estimate.accel == pytest.approx((0.0, 0.0, -9.80665), abs=1e-9)
    assert estimate.gyro == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    assert math.hypot(*estimate.mag) == pytest.approx(0.58, rel=0.06)
    assert estimate.pressure == pytest.approx(945.0, abs=1.5)  # recorded at this place
    assert estimate.rangefinder == pytest.approx(0.115, abs=0.01)
    assert estimate.battery_volts == pytest.approx(12.6, abs=0.05)
    assert estimate.battery_used_mah < 1.0
    assert estimate.battery_left == pytest.approx(1.0, abs=1e-3)


def test_the_range_finder_reports_nothing_beyond_its_range(drone):
    flown = drone("perfect").hover(20.0)
    assert flown.flight.estimate().rangefinder == pytest.approx(20.1, abs=0.1)
    flown.drive(Control.POSITION, position=(0.0, 0.0, -40.0))
    flown.wait(20)
    assert flown.flight.estimate().rangefinder is None


def test_a_stuck_barometer_and_magnetometer_repeat_their_samples(drone):
    flown = drone("consumer")
    flown.wait(1)
    flown.flight.block_barometer()
    flown.flight.block_compass()
    flown.wait(0.1)
    before = flown.flight.estimate()
    flown.wait(2)
    after = flown.flight.estimate()
    assert (after.baro_altitude, after.mag) == (before.baro_altitude, before.mag)
    assert after.gyro != before.gyro


def test_losing_half_of_a_motor_turns_the_vehicle_over(drone):
    flown = drone("perfect").hover(30.0)
    flown.flight.weaken_motor(0, 0.0)
    flown.wait(3)
    truth = flown.flight.truth()
    assert truth.position[2] < 25.0


def test_payload_power_is_drawn_from_the_battery(drone):
    flown = drone("perfect")
    flown.wait(1)
    before = flown.flight.estimate().battery_amps
    flown.flight.payload_power(10.0)
    flown.wait(1)
    assert flown.flight.estimate().battery_amps - before == pytest.approx(10.0 / 12.6, rel=0.01)
    assert flown.flight.truth().payload_j == pytest.approx(10.0, abs=0.1)


def test_fixes_arrive_at_the_declared_rate(drone):
    for sensors, rate in (("consumer", 5), ("rtk", 10)):
        flown = drone(sensors)
        first = flown.wait(1)[-1][1].gps.count
        assert flown.wait(10)[-1][1].gps.count - first == 10 * rate


def test_an_error_of_the_firmwares_estimator_is_in_the_estimate_alone(drone):
    flown = drone("perfect").hover()
    before, truth = flown.wait(0.05)[0][1:]
    flown.flight.estimate_error = 0.5, -0.25, 0.1, 0.2, 0.3, -0.1
    after, same = flown.wait(0.05)[0][1:]
    pairs = zip(after.position + after.velocity, before.position + before.velocity, strict=True)
    moved = [a - b for a, b in pairs]
    assert moved == pytest.approx([0.5, -0.25, 0.1, 0.2, 0.3, -0.1], abs=1e-3)
    assert same.position == pytest.approx(truth.position, abs=1e-3)


def test_the_firmwares_own_noise_follows_from_seed_stream_and_number(drone):
    first, second = drone(seed=1).flight, drone(seed=2).flight
    draws = [first.draw(stream, number) for stream in range(4) for number in range(500)]
    assert first.draw(1, 7) == draws[507]
    assert second.draw(1, 7) != draws[507]
    assert fmean(draws) == pytest.approx(0.0, abs=0.1)
    assert pstdev(draws) == pytest.approx(1.0, abs=0.05)
