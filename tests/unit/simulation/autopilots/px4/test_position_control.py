"""Laws of PX4's trajectory, loops and estimate, each in the function that has it; and whole flights."""

from math import hypot
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from volery import Drone, Options, Position, fly, sleep
from volery.base.time import from_seconds
from volery.simulation.autopilots.px4.airframe_loops import HOVER, step_loops
from volery.simulation.autopilots.px4.error_states import TILT
from volery.simulation.autopilots.px4.estimate_error import start_errors
from volery.simulation.autopilots.px4.loop_state import (
    A_FLOWN,
    A_GROUNDED,
    A_HOVER,
    A_INTEGRAL,
    A_POSITION,
    A_RAMP,
    A_THRUST,
    A_VELOCITY,
    E_COVARIANCE,
    E_POSITION,
    E_STATES,
    G_JERK,
    G_OWN_HOVER,
    GRAVITY,
    I_AT_VEHICLE,
    I_DOWN,
    I_LIFT,
    I_POSITION,
    I_SPEED,
    I_TASK,
    I_UP,
    LOOP_COLUMNS,
    SINK,
    STATES,
    SUBSTEP,
    T_POSITION,
    T_VELOCITY,
    TO_POINT,
)
from volery.simulation.autopilots.px4.position_control import gains_of, settling
from volery.simulation.autopilots.px4.trajectory import move_trajectory, shortest, straight, within
from volery.simulation.world.state_layout import Array

PARAMETERS = {
    "MPC_JERK_AUTO": 4.0,
    "MPC_ACC_HOR": 3.0,
    "MPC_XY_ERR_MAX": 2.0,
    "MPC_ACC_DOWN_MAX": 3.0,
    "MPC_XY_P": 0.95,
    "MPC_Z_P": 1.0,
    "MPC_XY_VEL_P_ACC": 1.8,
    "MPC_XY_VEL_I_ACC": 0.4,
    "MPC_XY_VEL_D_ACC": 0.2,
    "MPC_Z_VEL_P_ACC": 4.0,
    "MPC_Z_VEL_I_ACC": 2.0,
    "MPC_Z_VEL_D_ACC": 0.0,
    "MPC_Z_V_AUTO_DN": 1.5,
    "MPC_TKO_RAMP_T": 3.0,
    "MPC_THR_HOVER": 0.5,
    "MPC_YAWRAUTO_MAX": 45.0,
}
KEY = np.uint64(7)


def airborne() -> Array:
    """Return the state of an aircraft that hovers."""
    row = np.zeros(LOOP_COLUMNS)
    tuning = SimpleNamespace(tilt=0.785, speed=12.0, speed_up=3.0, speed_down=1.5)
    vehicle: Any = SimpleNamespace(parameters=PARAMETERS, tuning=tuning, flight=SimpleNamespace(spec=None))
    gains = gains_of(vehicle, automatic=True)
    assert G_JERK + len(gains) == G_OWN_HOVER + 1
    row[G_JERK : G_JERK + len(gains)] = gains
    row[[I_SPEED, I_UP, I_DOWN, I_LIFT]] = 5.0, 3.0, 1.5, 4.0
    row[[A_RAMP, A_HOVER, A_HOVER + 1]] = 1.0, HOVER, HOVER
    start_errors(row)
    return row


def flown(row: Array, seconds: float) -> Array:
    for step in range(round(seconds / SUBSTEP)):
        move_trajectory(row)
        step_loops(row, KEY, step)
    return row


def cruising(seconds: float) -> Array:
    """Return the state after a flight to the north with 4.8 m/s and down with 1.1 m/s."""
    row = airborne()
    row[I_POSITION : I_POSITION + 9] = np.nan
    row[I_POSITION + 3 : I_POSITION + 6] = 4.8, 0.0, 1.1
    for step in range(round(seconds / SUBSTEP)):
        step_loops(row, KEY, step)
    return row


@pytest.mark.parametrize(("uptime", "seconds"), [(3.0, 0.0), (16.5, 10.0), (66.5, 60.0), (4000.0, 60.0)])
def test_the_estimate_has_run_since_the_heading_was_aligned(uptime: float, seconds: float) -> None:
    first, end = settling(from_seconds(uptime))
    assert (end - first) * SUBSTEP == pytest.approx(seconds)


def test_a_fast_limit_keeps_the_direction() -> None:
    assert straight(80.0, 0.0, 60.0, 5.0, 1.5) == pytest.approx((2.0, 0.0, 1.5))


def test_a_slow_end_of_the_height_does_not_slow_the_plane() -> None:
    """clampToZNorm scales the height alone where both its speed and its limit are below 0.5 m/s."""
    north, east, down = straight(9.0, 0.0, 1.0, 3.0, 0.3)
    assert hypot(north, east) == pytest.approx(3.0 * 9.0 / hypot(9.0, 1.0), rel=0.03)
    assert down == pytest.approx(0.3)


def test_at_the_point_nothing_moves() -> None:
    assert straight(0.0, 0.0, 0.0, 5.0, 1.0) == (0.0, 0.0, 0.0)


def test_a_velocity_changes_with_the_largest_jerk_and_acceleration() -> None:
    """From rest to 5 m/s with 4 m/s^3 and 3 m/s^2: the area of a trapezoid of 0.75, 0.917 and 0.75 s."""
    assert shortest(0.0, 5.0, 4.0, 3.0) == pytest.approx((0.75, 5.0 / 3.0 - 0.75, 0.75))
    assert shortest(0.0, -1.0, -4.0, 3.0) == pytest.approx((0.5, 0.0, 0.5))


def test_a_faster_axis_takes_as_long_as_the_slowest() -> None:
    rising, steady, falling = within(0.0, 1.0, 4.0, 3.0, 2.0)
    assert rising + steady + falling == pytest.approx(2.0)
    peak = 4.0 * rising
    assert peak * (steady + 0.5 * (rising + falling)) == pytest.approx(1.0)


def test_the_trajectory_reaches_its_point_without_passing_it() -> None:
    row = airborne()
    row[I_TASK] = TO_POINT
    row[I_POSITION : I_POSITION + 3] = 30.0, -40.0, -10.0
    farthest = 0.0
    for step in range(round(40.0 / SUBSTEP)):
        move_trajectory(row)
        row[A_POSITION : A_POSITION + 3] = row[T_POSITION : T_POSITION + 3]
        farthest = max(farthest, row[T_POSITION])
        speed = hypot(row[T_VELOCITY], row[T_VELOCITY + 1])
        assert speed < 5.05, step
    assert row[T_POSITION : T_POSITION + 3] == pytest.approx([30.0, -40.0, -10.0], abs=0.01)
    assert farthest < 30.01


def test_the_trajectory_waits_for_an_aircraft_that_is_beside_it() -> None:
    """A landing at 0.7 m/s with the aircraft 0.5 m to the side: a quarter of MPC_XY_ERR_MAX slower."""
    row = airborne()
    row[I_TASK], row[I_DOWN] = SINK, 0.7
    row[A_POSITION : A_POSITION + 2] = 0.5, 0.0
    for _ in range(round(20.0 / SUBSTEP)):
        move_trajectory(row)
    before = row[T_POSITION + 2]
    move_trajectory(row)
    assert row[T_POSITION + 2] - before == pytest.approx(0.75 * 0.7 * SUBSTEP)


def test_a_take_off_lifts_off_when_its_trajectory_climbs() -> None:
    """It begins 0.7 m/s downwards and gains MPC_TKO_SPEED / MPC_TKO_RAMP_T: it climbs from 1.4 s on."""
    row = airborne()
    row[[A_GROUNDED, A_RAMP, A_THRUST + 2, A_HOVER]] = 1.0, 0.0, GRAVITY, 0.5
    row[[I_TASK, I_UP, I_LIFT, I_AT_VEHICLE, T_VELOCITY + 2]] = TO_POINT, 1.5, 0.5, 1.0, 0.7
    row[I_POSITION + 2] = -10.0
    flown(row, 1.4)
    assert row[A_GROUNDED] == 1.0
    flown(row, 1.4)
    assert row[A_GROUNDED] == 0.0
    flown(row, 4.0)
    assert row[A_FLOWN + 2] == pytest.approx(-1.5, abs=0.15)


def test_the_integral_holds_the_whole_drag_at_the_end_of_a_long_descent() -> None:
    """Logged of PX4 1.14 in SIH at 4.7 m/s: 4.8 m/s^2. Without the estimated hover thrust it was 4.0."""
    row = cruising(60.0)
    assert row[A_VELOCITY : A_VELOCITY + 3] == pytest.approx([4.8, 0.0, 1.1], abs=0.02)
    assert row[A_INTEGRAL] > 4.7


def test_the_stated_position_is_ahead_of_the_flown_one() -> None:
    """Logged of thirteen flights in SIH at 4.9 m/s: 0.26 to 0.47 m, on average 0.33 m."""
    row = cruising(60.0)
    assert row[E_POSITION] == pytest.approx(0.08 * 4.8, abs=0.02)


def test_what_is_wrong_with_the_tilt_pushes_the_aircraft_the_other_way() -> None:
    """The attitude loops hold the estimated tilt: a gyroscope's error of 0.3 m/s^2 moves the aircraft."""
    row = airborne()
    row[I_POSITION : I_POSITION + 9] = np.nan
    row[I_POSITION + 3 : I_POSITION + 6] = 0.0
    row[E_STATES + TILT] = 0.3
    row[E_COVARIANCE : E_COVARIANCE + STATES * STATES] = 0.0  # the filter does not correct it
    for step in range(150):
        step_loops(row, KEY, step)
    assert row[A_FLOWN] < -0.2
    assert abs(row[A_VELOCITY]) < 0.4 * abs(row[A_FLOWN])


def test_the_noise_of_a_flight_follows_from_its_seed() -> None:
    def hovered(seed: int) -> list[Position]:
        places = []

        def hover(drone: Drone) -> None:
            drone.takeoff(5)
            for _ in range(10):
                sleep(1)
                places.append(drone.position)

        fly(hover, "sim:px4?start=warm&sensors=sih", Options(seed=seed))
        return places

    assert hovered(1) == hovered(1)
    assert hovered(1) != hovered(2)


def test_it_lands_where_it_was_when_land_was_commanded() -> None:
    """Navigator's ``set_land_item`` takes the present position, not where the vehicle can stop."""
    places = []

    def land(drone: Drone) -> None:
        drone.takeoff(10)
        drone.set_velocity(north=3, lasting=4)
        assert drone.velocity.north > 1.5
        places.append(drone.position)
        drone.land()
        places.append(drone.position)

    fly(land, "sim:px4?start=warm", Options(seed=1))
    commanded, landed = places
    assert abs(landed.latitude - commanded.latitude) * 111_200.0 < 0.6


def test_the_nose_points_to_where_it_flies() -> None:
    """MPC_YAW_MODE 0: towards the point while it is farther than NAV_ACC_RAD."""
    headings = []

    def turn(drone: Drone) -> None:
        drone.takeoff(5)
        here = drone.position
        drone.goto(Position(here.latitude, here.longitude + 0.0005, here.altitude))
        headings.append(drone.attitude.heading)

    fly(turn, "sim:px4?start=warm", Options(seed=1))
    assert headings == [pytest.approx(90.0, abs=5.0)]
