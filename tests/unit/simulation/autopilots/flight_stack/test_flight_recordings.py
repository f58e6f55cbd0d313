"""What the simulated vehicle does beside what the real firmware was recorded doing, within a fifth."""

import math

import pytest

from volery.simulation.autopilots.flight_stack.flight import Control

FIFTH = 0.2


@pytest.fixture(params=["perfect", "consumer"])
def sensors(request):
    return request.param


def test_climb_to_ten_metres(drone, recorded, sensors):
    figures = recorded["copter"]["climb_to_10_m"]
    flown = drone(sensors).ready()
    flown.drive(Control.POSITION, position=(0.0, 0.0, -10.0))
    seen = flown.wait(15)
    lifted = next(after for after, _, truth in seen if truth.velocity[2] > 0.15)
    reached = next(after for after, estimate, _ in seen if -estimate.position[2] > 9.5)
    assert reached - lifted == pytest.approx(figures["from_lift_off_to_9_5_m_s"], rel=FIFTH)
    assert max(-estimate.velocity[2] for _, estimate, _ in seen) == pytest.approx(
        figures["top_speed_m_s"], rel=FIFTH
    )
    assert max(-estimate.position[2] for _, estimate, _ in seen) < 10.3


def test_leg_of_fifty_metres(drone, recorded, sensors):
    figures = recorded["copter"]["leg_of_50_m"]
    flown = drone(sensors).hover()
    flown.drive(Control.POSITION, position=(50.0, 0.0, -10.0))
    seen = flown.wait(25)
    unsettled = [
        after
        for after, estimate, _ in seen
        if abs(estimate.position[0] - 50.0) > 0.5 or estimate.velocity[0] > 0.3
    ]
    peak = max(estimate.velocity[0] for _, estimate, _ in seen)
    assert unsettled[-1] == pytest.approx(figures["settled_s"], rel=FIFTH)
    assert peak == pytest.approx(figures["peak_m_s"], rel=FIFTH)
    overshoot = max(estimate.position[0] for _, estimate, _ in seen) - 50.0
    assert overshoot == pytest.approx(figures["overshoot_m"], rel=FIFTH)
    assert max(abs(estimate.position[2] + 10.0) for _, estimate, _ in seen) < 0.5


def test_landing_from_ten_metres(drone, recorded, sensors):
    figures = recorded["copter"]["landing_from_10_m"]
    flown = drone(sensors).hover()
    flown.drive(Control.POSITION_CLIMB, climb=-0.5)
    seen = flown.wait(40, until=lambda estimate, truth: estimate.landed)
    assert seen[-1][0] == pytest.approx(figures["landed_s"], rel=FIFTH)
    assert seen[-1][2].on_ground
    assert seen[-1][2].contact_speed == pytest.approx(figures["speed_m_s"], abs=0.15)


def test_hover_takes_the_recorded_throttle(drone, recorded):
    flown = drone("perfect").hover()
    estimate = flown.flight.estimate()
    assert estimate.throttle == pytest.approx(recorded["copter"]["hover_throttle"], rel=FIFTH)
    assert estimate.motor_pwm[0] == pytest.approx(recorded["copter"]["hover_pwm"], abs=60)


def test_rover_to_a_point_and_home(rover, recorded):
    figures = recorded["rover"]
    start = figures["start"]
    flown = rover(at=(start["east_m"], start["north_m"], 0.0), heading_deg=start["heading_deg"]).ready()
    flight = flown.flight
    for north, expected in ((50.0, figures["to_50_m_north"]), (0.0, figures["home"])):
        goal = flight.to_ned(*flight.frame.from_ned((north, 0.0, 0.0)))
        flown.drive(Control.POSITION, position=goal, speed=5.0, accel=1.0)
        seen = flown.wait(40)
        near = next(after for after, estimate, _ in seen if math.dist(estimate.position[:2], goal[:2]) < 3.0)
        assert near == pytest.approx(expected["within_3_m_s"], rel=FIFTH)
        assert math.dist(seen[-1][1].position[:2], goal[:2]) < 0.6
        if "peak_m_s" in expected:
            peak = max(math.hypot(*estimate.velocity[:2]) for _, estimate, _ in seen)
            assert peak == pytest.approx(expected["peak_m_s"], rel=FIFTH)


def test_rover_holds_a_speed_and_a_turn_rate(rover, recorded):
    figures = recorded["rover"]["circle"]
    flown = rover().ready()
    flown.drive(
        Control.DRIVE,
        velocity=(figures["speed_m_s"], 0.0, 0.0),
        yaw_rate=figures["turn_rate_rad_s"],
        speed=5.0,
        accel=1.0,
    )
    truth = flown.wait(8)[-1][2]
    assert math.hypot(*truth.velocity[:2]) == pytest.approx(figures["speed_m_s"], rel=0.05)
    assert -truth.rates[2] == pytest.approx(figures["turn_rate_rad_s"], rel=0.05)
