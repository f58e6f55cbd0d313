"""Laws of PX4's trajectory and loops: limits along a straight line, the estimated hover thrust."""

from math import hypot
from types import SimpleNamespace
from typing import Any

import pytest

from volery import Drone, Options, Position, fly, sleep
from volery.simulation.autopilots.px4.estimate_error import QUIET, Noise
from volery.simulation.autopilots.px4.position_control import (
    SUBSTEP,
    AirframeLoops,
    Cruise,
    Gains,
    Wanted,
    _straight,
)

PARAMETERS = {
    "MPC_JERK_AUTO": 4.0,
    "MPC_ACC_HOR": 3.0,
    "MPC_XY_ERR_MAX": 2.0,
    "MPC_ACC_UP_MAX": 4.0,
    "MPC_ACC_DOWN_MAX": 3.0,
    "MPC_XY_P": 0.95,
    "MPC_Z_P": 1.0,
    "MPC_XY_VEL_P_ACC": 1.8,
    "MPC_XY_VEL_I_ACC": 0.4,
    "MPC_XY_VEL_D_ACC": 0.2,
    "MPC_Z_VEL_P_ACC": 4.0,
    "MPC_Z_VEL_I_ACC": 2.0,
    "MPC_Z_VEL_D_ACC": 0.0,
}
CRUISE = Cruise(12.0, 3.0, 1.5)


def gains() -> Gains:
    vehicle: Any = SimpleNamespace(parameters=PARAMETERS, tuning=SimpleNamespace(tilt=0.785))
    return Gains(vehicle)


def flown(velocity: tuple[float, float, float], seconds: float) -> AirframeLoops:
    nothing = float("nan")
    loops, wanted = AirframeLoops((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), Wanted(*[(nothing,) * 3] * 3)
    for _ in range(round(seconds / SUBSTEP)):
        loops.step(gains(), wanted._replace(velocity=velocity), CRUISE)
    return loops


def test_a_fast_limit_keeps_the_direction() -> None:
    north, east, down = _straight((80.0, 0.0, 60.0), 5.0, 1.5)
    assert (north, east, down) == pytest.approx((2.0, 0.0, 1.5))


def test_a_slow_end_of_the_height_does_not_slow_the_plane() -> None:
    """clampToZNorm scales the height alone where both its speed and its limit are below 0.5 m/s."""
    north, east, down = _straight((9.0, 0.0, 1.0), 3.0, 0.3)
    assert hypot(north, east) == pytest.approx(3.0 * 9.0 / hypot(9.0, 1.0), rel=0.03)
    assert down == pytest.approx(0.3)


def test_at_the_point_nothing_moves() -> None:
    assert _straight((0.0, 0.0, 0.0), 5.0, 1.0) == (0.0, 0.0, 0.0)


def test_the_integral_holds_the_whole_drag_at_the_end_of_a_long_descent() -> None:
    """Logged of PX4 1.14 in SIH at 4.7 m/s: 4.8 m/s^2. Without the estimated hover thrust it was 4.0."""
    loops = flown((4.8, 0.0, 1.1), 60.0)
    assert loops.velocity == pytest.approx([4.8, 0.0, 1.1], abs=0.02)
    assert loops._integral[0] > 4.7


def test_the_stated_position_is_ahead_of_the_flown_one() -> None:
    loops = flown((4.8, 0.0, 0.0), 60.0)
    assert loops.position[0] > 0.0
    assert loops.moving[0] == pytest.approx(4.8, abs=0.02)
    assert loops.errors[0].position == pytest.approx(0.06 * 4.8, abs=0.01)


def test_what_is_wrong_with_the_tilt_pushes_the_aircraft_the_other_way() -> None:
    """The attitude loops hold the estimated tilt: a gyroscope's error of 0.3 m/s^2 moves the aircraft."""
    nothing = float("nan")
    loops = AirframeLoops((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    wanted = Wanted(*[(nothing,) * 3] * 3)._replace(velocity=(0.0, 0.0, 0.0))
    loops.step(gains(), wanted, CRUISE, (Noise(tilt=0.3), QUIET, QUIET))
    for _ in range(50):
        loops.step(gains(), wanted, CRUISE)
    assert loops._flown[0] < -0.1
    assert abs(loops.velocity[0]) < 0.05


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
