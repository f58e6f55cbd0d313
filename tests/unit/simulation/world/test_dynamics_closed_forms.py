"""Equations of motion against closed-form solutions."""

import math

import pytest

from volery.base.time import S
from volery.simulation.world.body_specs import STANDARD_GRAVITY, Multirotor, WheeledRover
from volery.simulation.world.dynamics import S_SPEED, S_STEER, write_quaternion
from volery.simulation.world.state_layout import (
    S_ATTITUDE,
    S_ON_GROUND,
    S_POSITION,
    S_RESTING,
    S_ROTORS,
    S_VELOCITY,
    U_MOTOR_HEALTH,
    U_THROTTLE,
)
from volery.simulation.world.world import STEP, World


@pytest.fixture
def dragless(ideal_battery):
    return Multirotor(
        sensors="perfect", battery=ideal_battery, drag_linear=0.0, drag_quadratic=0.0, spin_damping=0.0
    )


def in_the_air(world, spec, height, rotors):
    """Put the body of a world into the air, with rotors at speeds that its commands hold."""
    row = world.arrays.rows[0]
    row[S_POSITION + 2] = height
    row[S_RESTING] = 0.0
    row[S_ON_GROUND] = 0.0
    row[S_ROTORS : S_ROTORS + 4] = rotors
    row[U_THROTTLE : U_THROTTLE + 4] = [speed / spec.top_speed for speed in rotors]


def test_free_fall_is_exact_to_a_micrometre_in_ten_seconds(clock, frame, dragless):
    world = World(clock, [dragless], frame=frame)
    in_the_air(world, dragless, 1000.0, (0.0,) * 4)
    clock.wait(10)
    truth = world.truth(0)
    assert truth.position[2] == pytest.approx(1000.0 - STANDARD_GRAVITY * 50.0, abs=1e-6)
    assert truth.velocity[2] == pytest.approx(-STANDARD_GRAVITY * 10.0, abs=1e-9)


def test_yaw_angle_under_constant_torque(clock, frame, dragless):
    left, right = 440.0, 430.0
    world = World(clock, [dragless], frame=frame)
    speeds = [left if rotor.spin > 0 else right for rotor in dragless.rotors]
    in_the_air(world, dragless, 10_000.0, speeds)
    torque = 2.0 * dragless.torque_coefficient * (left**2 - right**2)
    acceleration = torque / dragless.inertia[2]
    heading = math.pi / 2  # the body faces north
    turned = 0.0
    for _ in range(100):
        clock.wait(0.1)
        w, _, _, z = world.truth(0).attitude
        now = 2.0 * math.atan2(z, w)
        turned += math.remainder(now - heading - turned, 2.0 * math.pi)
    # to third order in a step's half angle the midpoint method turns a quaternion too far: x + x^3 / 6
    excess = (acceleration * STEP / S / 2.0) ** 2 / 6.0 * acceleration * 10.0**4 / 4.0
    assert excess < 1e-5
    assert turned == pytest.approx(0.5 * acceleration * 100.0 + excess, rel=1e-9)
    assert world.truth(0).rates[2] == pytest.approx(acceleration * 10.0, rel=1e-9)


def test_a_body_at_hover_thrust_keeps_its_position(clock, frame, dragless):
    world = World(clock, [dragless], frame=frame)
    in_the_air(world, dragless, 100.0, (dragless.hover_speed,) * 4)
    clock.wait(60)
    east, north, up = world.truth(0).position
    assert max(abs(east), abs(north), abs(up - 100.0)) < 1e-8


@pytest.mark.parametrize("rotors", [0.0, 0.7, 1.3])
def test_terminal_velocity_balances_weight_thrust_inflow_and_a_drag_that_grows_with_the_rotors(
    rotors, clock, frame, ideal_battery
):
    spec = Multirotor(sensors="perfect", battery=ideal_battery, rotor_lag=1e9)
    world = World(clock, [spec], frame=frame)
    in_the_air(world, spec, 5000.0, (rotors * spec.hover_speed,) * 4)
    clock.wait(60)
    speed = world.truth(0).velocity[2]
    drag = (rotors * spec.drag_linear + spec.drag_quadratic * abs(speed)) * speed
    weight = spec.mass * STANDARD_GRAVITY
    jet = 2.0 * spec.hover_power / weight
    drag += weight * (max(0.0, speed) / jet) ** 2
    assert drag == pytest.approx((rotors * rotors - 1.0) * weight, rel=1e-6)


def test_motor_lag_is_first_order(clock, frame, dragless):
    world = World(clock, [dragless], frame=frame)
    world.set_input(0, U_THROTTLE, 0.5, 0.5, 0.5, 0.5)
    clock.now = STEP
    world.advance_to_now(0)
    clock.wait(0.1)
    expected = 0.5 * dragless.top_speed * (1.0 - math.exp(-0.1 / dragless.rotor_lag))
    assert world.truth(0).rotors[0] == pytest.approx(expected, rel=1e-5)


def test_a_rover_speeds_up_with_its_lag_and_drives_a_circle_of_its_wheelbase(clock, frame, ideal_battery):
    spec = WheeledRover(sensors="perfect", battery=ideal_battery, speed_top=2.0, grip=100.0)
    world = World(clock, [spec], frame=frame)
    row = world.arrays.rows[0]
    row[U_THROTTLE + 1] = 1.0
    row[S_RESTING] = 0.0
    clock.wait(3)
    speed = world.truth(0).rotors[1]
    assert speed == pytest.approx(2.0 * (1.0 - math.exp(-3.0 / spec.speed_lag)), rel=1e-9)
    row[U_THROTTLE] = 1.0
    row[S_STEER], row[S_SPEED] = math.radians(spec.steer_top_deg), 2.0
    before = world.truth(0)
    radius = spec.wheelbase / math.tan(math.radians(spec.steer_top_deg))
    clock.wait(2.0 * math.pi * radius / 2.0)
    after = world.truth(0)
    assert math.dist(before.position, after.position) < 2.0 * STEP / 1e9 * 1.01
    assert after.rates[2] == pytest.approx(2.0 / radius, rel=1e-9)


def test_a_skid_steered_rover_turns_on_the_spot(clock, frame, ideal_battery):
    spec = WheeledRover(sensors="perfect", battery=ideal_battery, skid=True)
    world = World(clock, [spec], frame=frame)
    world.set_input(0, U_THROTTLE, 0.5, 0.0)
    clock.wait(3)
    truth = world.truth(0)
    assert truth.rates[2] == pytest.approx(math.radians(spec.turn_top_deg) * 0.5, rel=1e-6)
    assert truth.position[:2] == (0.0, 0.0)


def test_a_dropped_body_touches_down_with_the_speed_of_its_fall(clock, frame, dragless):
    world = World(clock, [dragless], frame=frame)
    in_the_air(world, dragless, 1.0 + dragless.feet[2], (0.0,) * 4)
    while not world.truth(0).on_ground:
        clock.now += STEP
    assert world.truth(0).contact_speed == pytest.approx(math.sqrt(2.0 * STANDARD_GRAVITY), abs=0.03)
    assert world.truth(0).contacts == 1
    clock.wait(3)
    truth = world.truth(0)
    assert truth.on_ground
    assert truth.velocity == (0.0, 0.0, 0.0)
    assert truth.position[2] == pytest.approx(dragless.feet[2], abs=0.01)


@pytest.mark.parametrize(("roll", "pitch"), [(0.0, 0.0), (-1.2, -13.4), (-5.0, 9.0), (25.0, 10.0)])
def test_a_fall_of_fifteen_metres_per_second_ends_on_the_feet_without_a_rebound(
    roll, pitch, clock, frame, dragless
):
    world = World(clock, [dragless], frame=frame)
    in_the_air(world, dragless, 0.4, (0.0,) * 4)
    row = world.arrays.rows[0]
    write_quaternion(row, S_ATTITUDE, math.radians(roll), math.radians(pitch), 0.3)
    row[S_VELOCITY + 2] = -15.0
    highest, turning = 0.0, 0.0
    for _ in range(500):
        clock.now += STEP
        truth = world.truth(0)
        if truth.contacts:
            highest = max(highest, truth.position[2])
            turning += STEP / S if abs(truth.rates[2]) > math.radians(10.0) else 0.0
    assert truth.attitude[1:3] == pytest.approx((0.0, 0.0), abs=0.01)
    assert highest < 0.2
    assert turning < 0.06


def test_a_body_upside_down_lies_on_the_ground_and_not_in_it(clock, frame, dragless):
    world = World(clock, [dragless], frame=frame)
    in_the_air(world, dragless, 1.0, (0.0,) * 4)
    world.arrays.rows[0, 6:10] = 0.0, 1.0, 0.0, 0.0
    clock.wait(5)
    assert world.truth(0).position[2] == pytest.approx(dragless.feet[2], abs=0.02)


def test_differential_thrust_rotates_the_body_according_to_the_rotor_positions(clock, frame, dragless):
    """More thrust in front pitches up (backwards), more on the left rolls right."""
    for stronger, axis, sign in (
        (lambda rotor: rotor.forward > 0, 1, -1),
        (lambda rotor: rotor.left > 0, 0, 1),
    ):
        clock.now = 0
        world = World(clock, [dragless], frame=frame)
        speeds = [450.0 if stronger(rotor) else 430.0 for rotor in dragless.rotors]
        in_the_air(world, dragless, 100.0, speeds)
        clock.wait(0.1)
        rates = world.truth(0).rates
        assert math.copysign(1.0, rates[axis]) == sign
        assert max(abs(rates[other]) for other in range(3) if other != axis) < 1e-6 * abs(rates[axis])


def test_a_weaker_motor_gives_less_thrust_and_rolls_the_body_towards_it(clock, frame, dragless):
    world = World(clock, [dragless], frame=frame)
    in_the_air(world, dragless, 100.0, (dragless.hover_speed,) * 4)
    front_right = 0
    world.arrays.rows[0, U_MOTOR_HEALTH + front_right] = 0.8
    clock.wait(0.1)
    roll, pitch, _ = world.truth(0).rates
    assert roll > 0.01
    assert pitch > 0.01
